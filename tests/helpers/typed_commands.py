"""Commands typed as a user types them, and what is expected of their answers."""

import re
from pathlib import Path

from click.testing import CliRunner, Result

from helpers.small_world import write_images, write_tokens
from placerec.cli import commands

SMALL = ("--as-in-paper", "--size", 3, "--image-size", 16, "-q")


def placerec(*args: object, stdin: str | bytes | None = None) -> Result:
    return CliRunner().invoke(commands, [str(arg) for arg in args], prog_name="placerec", input=stdin)


def done(*args: object, stdin: str | bytes | None = None) -> Result:
    result = placerec(*args, stdin=stdin)
    assert result.exit_code == 0, result.output
    return result


def fails(message: str, *args: object) -> None:
    """Exit code 1 and one line on stderr, the last one, that says `message`; nothing on stdout."""
    result = placerec(*args)
    assert result.exit_code == 1, result.output
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.stdout == ""
    errors = [line for line in result.stderr.splitlines() if line.startswith("placerec: ")]
    assert errors == result.stderr.splitlines()[-1:]
    assert re.search(message, errors[0]), errors[0]


def misused(message: str, *args: object) -> None:
    """Exit code 2, and a message that says what is wrong and where help is, in one line on stderr."""
    result = placerec(*args)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("placerec")
    assert message in line, line
    assert re.search(r"; (for example: placerec |see `placerec.* --help`$)", line), line


def make_words(root: Path) -> None:
    """Two image sequences, a dictionary of the first, their tokens, and a model of the first."""
    for seed, name in enumerate(("seq1", "seq2")):
        write_images(root / "runs" / name, seed)
    done("train-words", root / "runs/seq1", "-o", root / "words.npz", *SMALL)
    done("tokenize", root / "runs", "-w", root / "words.npz", "-o", root / "seen", "-q")
    done("train-lm", root / "seen/seq1.tsv", "-o", root / "seen-model", "-q")


def make_world(root: Path) -> Path:
    """Two image sequences, a dictionary of each, tokens, models of words that need no image, and beliefs: in `root`."""
    make_words(root)
    done("train-words", root / "runs/seq2", "-o", root / "other.npz", *SMALL)
    write_tokens(root / "tokens")
    done("train-lm", root / "tokens/run1.tsv", root / "tokens/run2.tsv", "-o", root / "model", "-q")
    done("decode", root / "tokens/run3.tsv", "-m", root / "model", "-o", root / "beliefs", "-q")
    return root
