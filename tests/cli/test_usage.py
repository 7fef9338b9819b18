"""Wrong usage: one line on stderr with what is wrong and a remedy, exit code 2, and nothing is written."""

from pathlib import Path

import pytest
from helpers.typed_commands import make_world, misused, placerec

from placerec.cli import commands
from placerec.srilm.tools.run import TOOLS

NAMES = sorted(set(commands.commands) - {*TOOLS, "demo"})


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make_world` makes, for all tests here."""
    return make_world(tmp_path_factory.mktemp("world"))


def test_no_command_is_an_error_of_usage() -> None:
    result = placerec()
    assert result.exit_code == 2
    assert "train-words" in result.stderr


def test_unknown_commands_and_options_are_errors_of_usage() -> None:
    misused("No such command 'train'", "train")
    misused("No such option", "decode", "--frob")
    misused("Missing argument 'SOURCE...'", "train-words")
    misused("Missing option '-m' / '--model'", "decode", "tokens")
    misused("Missing option '-o' / '--out'", "train-lm", "tokens")


@pytest.mark.parametrize("name", NAMES)
def test_a_command_without_arguments_says_what_it_wants_by_its_example(name: str) -> None:
    misused("Missing argument", name)
    (line,) = placerec(name).stderr.splitlines()
    assert line.startswith(f"placerec {name}: ")
    assert f"; for example: placerec {name} " in line


def test_wrong_usage_is_one_line_with_a_remedy(world: Path) -> None:
    for told, *typed in (
        ("placerec: No such command 'foo'; see `placerec --help`", "foo"),
        ("placerec: No such option '--foo'; see `placerec --help`", "--foo"),
        (
            "placerec decode: Missing argument 'TOKENS...'; "
            "for example: placerec decode tokens/run3.tsv -m model/ -o beliefs/",
            "decode",
        ),
        (
            "placerec inspect: Missing argument 'MODEL.arpa|MODEL/|NAME.explain.jsonl'; "
            'for example: placerec inspect model/kitchen.arpa "w07 w08"',
            "inspect",
        ),
        (
            f"placerec show-words: Invalid value for 'words.npz': File '{world}' is a directory; "
            "for example: placerec show-words words.npz RUNS/ -o words.png",
            *("show-words", world, "words.npz"),
        ),
        (
            "placerec lab: Invalid value for '--scale': 'big' is not one of 'tiny', 'small', 'paper'; "
            "see `placerec lab --help`",
            *("lab", "no", "--scale", "big"),
        ),
        (
            "placerec decode: Option '--model' requires an argument; see `placerec decode --help`",
            *("decode", "tokens", "--model"),
        ),
    ):
        result = placerec(*typed)
        # Older versions of click have a colon in the place of the quotes.
        said = result.stderr.replace("No such option: --foo;", "No such option '--foo';")
        assert (result.exit_code, result.stdout, said) == (2, "", f"{told}\n")


@pytest.mark.parametrize(
    ("command", "option", "value", "message"),
    [
        ("train-lm", "--order", "0", "0 is not in the range 1<=x<=9"),
        ("train-lm", "--smoothing", "kn", "'kn' is not one of 'witten-bell', 'witten-bell-backoff'"),
        ("train-lm", "--delta", "0", "0.0 is not in the range x>0"),
        ("train-lm", "--delta", "nan", "nan is not a number that can be used"),
        ("train-lm", "--delta", "inf", "inf is not a number that can be used"),
        ("train-lm", "--select", "some", "Invalid value for '--select': selection 'some' is unknown; give none"),
        ("train-lm", "--select", "subsample:0", "selection 'subsample:0' is unknown"),
        ("train-lm", "--min-count", "0", "Invalid value for '--min-count': minimum count '0' is not understood"),
        ("decode", "--stay", "nan", "nan is not a number that can be used"),
        ("decode", "--stay", "1.5", "1.5 is not in the range 0<=x<=1"),
        ("decode", "--scorer", "srilm", "'srilm' is not one of 'native', 'kenlm'"),
        ("train-words", "--size", "1", "1 is not in the range 2<=x<=200"),
        ("train-words", "--fraction", "0", "0.0 is not in the range 0<x<=1"),
        ("train-words", "--fraction", "nan", "nan is not a number that can be used"),
        ("train-words", "--image-size", "100000", "100000 is not in the range 8<=x<=1024"),
        ("train-words", "--seed", "-1", "-1 is not in the range x>=0"),
        ("describe", "--variant", "gist", "'gist' is not one of 'lmgist', 'classic'"),
        ("tokenize", "--format", "video", "'video' is not one of 'auto', 'sequences', 'places'"),
        ("lab", "--scale", "big", "'big' is not one of 'tiny', 'small', 'paper'"),
    ],
)
def test_bad_values_are_errors_of_usage(world: Path, command: str, option: str, value: str, message: str) -> None:
    given: dict[str, list[object]] = {
        "train-lm": [world / "tokens", "-o", world / "no"],
        "decode": [world / "tokens/run3.tsv", "-m", world / "model"],
        "train-words": [world / "runs", "-o", world / "no"],
        "describe": [world / "runs", "-o", world / "no"],
        "tokenize": [world / "runs", "-w", world / "words.npz", "-o", world / "no"],
        "lab": [world / "no"],
    }
    misused(message, command, *given[command], option, value)
    assert not (world / "no").exists()


def test_empty_paths_and_dashes_are_refused_where_nothing_is_streamed(world: Path) -> None:
    misused("Invalid value for '-o' / '--out': the path is empty", "train-lm", world / "tokens", "-o", "")
    misused("Invalid value for 'SOURCE...': the path is empty", "train-words", "", "-o", world / "no")
    misused("`-` is no stream here; name a path", "train-lm", "-", "-o", world / "no")
    misused("`-` is no stream here; name a path", "describe", world / "runs", "-o", "-")


def test_a_folder_is_no_file_to_write(world: Path) -> None:
    for command in ("train-words", "describe"):
        misused("is a directory", command, world / "runs", "-o", world / "tokens")
