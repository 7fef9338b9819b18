"""`placerec compare` from the command line: its table, its files, and its refusals."""

from pathlib import Path

import pytest
from helpers.small_world import write_images
from helpers.typed_commands import placerec

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for seed in range(3):
        write_images(folder / f"run{seed}", seed)
    return folder


def test_it_prints_a_table_and_writes_the_folder(runs: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["compare", runs, "--test", runs / "run2", "--methods", "majority,hohmm", "--size", 2, "-o", out]
    done = placerec(*arguments)
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert lines[0].split()[:2] == ["method", "accuracy"]
    assert [line.split()[0] for line in lines[1:3]] == ["hohmm", "majority"]
    assert lines[3] == "12 frames; always 'hall': 50.0 %"
    assert "over its 2 visits" in done.stderr
    assert sorted(path.name for path in out.iterdir()) == [
        "beliefs",
        "cache",
        "methods.csv",
        "methods.png",
        "methods.svg",
        "pairs.csv",
        "report.html",
    ]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert '"systems":["hohmm","majority"]' in page
    assert page.count("data:image/webp") == 12


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--methods", "hohmm,svm"], 2, ("--methods", "'svm'", "torralba2003")),
        (["--methods", "hohmm,knn@nose:pn"], 2, ("--methods", "knn@nose:pn: no view", "'nose:pn'", "lbp")),
        (["--methods", ""], 2, ("--methods", "''")),
        ([], 1, ("none is left to learn from",)),
    ],
)
def test_what_cannot_be_compared_is_one_line(
    runs: Path, tmp_path: Path, arguments: list[str], code: int, words: tuple[str, ...]
) -> None:
    done = placerec("compare", runs, "--test", runs, "-o", tmp_path / "out", *arguments)
    assert done.exit_code == code
    assert all(word in done.stderr for word in words), done.stderr
    assert not (tmp_path / "out").exists()


def test_own_words_have_their_size(runs: Path, tmp_path: Path) -> None:
    words = tmp_path / "words.npz"
    assert placerec("train-words", runs / "run0", runs / "run1", "--sizes", "2", "-o", words).exit_code == 0
    arguments = ["compare", runs, "--test", runs / "run2", "--methods", "hohmm,wu2009", "-w", words]
    done = placerec(*arguments, "-o", tmp_path / "out")
    assert done.exit_code == 0, done.output
    done = placerec(*arguments, "--size", 20, "-o", tmp_path / "other")
    assert done.exit_code == 2
    assert "--size is of dictionaries that are learned, and -w names some; leave it out" in done.stderr


def test_a_test_sequence_is_needed(runs: Path, tmp_path: Path) -> None:
    done = placerec("compare", runs, "-o", tmp_path / "out")
    assert done.exit_code == 2
    assert "--test" in done.stderr
