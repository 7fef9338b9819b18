"""Every command that writes, where it cannot: one line that names the output, and no half of it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import Result
from helpers.small_world import write_tokens
from helpers.typed_commands import done, make_words, placerec

if sys.platform != "win32":
    import resource

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no such limit there")

COMMANDS = {
    "describe": ("describe", "runs", "-o", "OUT/d.npz", "--image-size", 16, "--jobs", 1),
    "train-words": ("train-words", "runs", "-o", "OUT/w.npz", "--image-size", 16, "--size", 2, "--jobs", 1),
    "tokenize": ("tokenize", "runs", "-w", "words.npz", "-o", "OUT/tokens", "--jobs", 1),
    "train-lm": ("train-lm", "tokens", "-o", "OUT/model"),
    "decode": ("decode", "tokens", "-m", "model", "-o", "OUT/beliefs"),
    "decode --explain": ("decode", "tokens", "-m", "model", "-o", "OUT/beliefs", "--explain"),
    "update": ("update", "OUT/learning", "later/run4.tsv"),
    "calibrate": ("calibrate", "OUT/learning", "later/run4.tsv"),
    "evaluate": ("evaluate", "beliefs/run3.tsv", "--plot", "OUT/plot.png"),
    "compare": ("compare", "runs/seq1", "--test", "runs/seq2", "-o", "OUT/compared", "--size", 2, "--methods", "hohmm"),
    "experiment": ("experiment", "grid.toml", "-o", "OUT/results", "--jobs", 1),
    "lab": ("lab", "OUT/lab", "--scale", "tiny"),
    "show-words": ("show-words", "words.npz", "runs/seq1", "-o", "OUT/words.png"),
    "show-frame": ("show-frame", "IMAGE", "-w", "words.npz", "-o", "OUT/frame.png"),
    "demo": ("demo", "-o", "OUT/demo"),
}


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    make_words(root)
    write_tokens(root / "tokens")
    write_tokens(root / "later", ["run4"])
    done("train-lm", root / "tokens", "-o", root / "model")
    done("decode", root / "tokens", "-m", root / "model", "-o", root / "beliefs")
    grid = '[data]\nsequences = ["runs/*"]\ntest = ["seq2"]\n[grid]\norder = [1]\nsmoothing = ["witten-bell"]\n'
    (root / "grid.toml").write_text(grid + 'select = ["none"]\nsize = [2]\nseeds = 1\n')
    return root


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """No file can grow larger; the system refuses it as it refuses what a full disk cannot hold."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# These take long if they are let go on.
SLOW = ("lab", "demo", "experiment", "compare")


@pytest.mark.parametrize(
    ("name", "size"), [(name, size) for name in COMMANDS for size in (0, 700, 9000) if size == 0 or name not in SLOW]
)
def test_a_file_is_whole_or_it_is_told(
    world: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, size: int
) -> None:
    monkeypatch.chdir(world)
    image = next((world / "runs/seq1/std_cam").iterdir())
    args = [str(arg).replace("OUT", str(tmp_path)).replace("IMAGE", str(image)) for arg in COMMANDS[name]]
    if name in ("update", "calibrate"):
        done("train-lm", "tokens", "-o", tmp_path / "learning")
    before = contents(tmp_path)
    with files_up_to(size):
        result: Result = placerec(*args)
    after = contents(tmp_path)
    if result.exit_code == 0:
        assert size > 0
        assert after != before
        return
    assert result.exit_code == 1, result.output
    assert isinstance(result.exception, SystemExit), result.exception
    errors = [line for line in result.stderr.splitlines() if "File too large" in line]
    if "; descriptors are not kept for other commands" in errors[0]:
        # Which is no error.
        assert errors.pop(0).startswith("warning: ")
    assert errors == result.stderr.splitlines()[-1:]
    assert f"{tmp_path}/" in errors[0]
    assert ".partial-" not in errors[0]
    whole = ("results/cache/", "compared/cache/")
    assert {path for path in after if not path.startswith(whole)} == set(before)
    assert {path: after[path] for path in before} == before
    assert not list(tmp_path.rglob(".*"))
