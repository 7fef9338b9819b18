"""The commands that turn images into words, as a user meets them."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images
from helpers.typed_commands import done, fails, make_words, misused

from placerec.frames import read_gray
from placerec.model import load_recognizer
from placerec.vision import DictionarySet
from placerec.words import read_stream


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make_words` makes."""
    root = tmp_path_factory.mktemp("world")
    make_words(root)
    return root


def test_sources_without_images_are_named(world: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file.txt").write_text("")
    for args in (["train-words"], ["describe"], ["tokenize", "-w", world / "words.npz"]):
        fails("nowhere: no such file or folder", *args, tmp_path / "nowhere", "-o", tmp_path / "no")
        fails("empty: no sequence there; looked for std_cam/, images", *args, tmp_path / "empty", "-o", tmp_path / "n")
        fails(r"file\.txt: is a file of no kind that is read", *args, tmp_path / "file.txt", "-o", tmp_path / "no")


def test_images_that_cannot_be_read_are_named_and_counted(world: Path, tmp_path: Path) -> None:
    write_images(tmp_path / "seq")
    bad = tmp_path / "seq/std_cam/t2000.000000_x0.000000_y0.000000_a0.000000.jpeg"
    bad.write_text("no picture")
    result = done("tokenize", tmp_path / "seq", "-w", world / "words.npz", "-o", tmp_path / "tokens")
    assert f"warning: {bad}: is no image that OpenCV can decode" in result.stderr
    assert "12 frames described, 1 skipped\n" in result.stderr
    assert len((tmp_path / "tokens/seq.tsv").read_text().splitlines()) == 13
    (tmp_path / "bad").mkdir()
    bad.rename(tmp_path / "bad/a.jpeg")
    for args in (["train-words"], ["describe"], ["tokenize", "-w", world / "words.npz"]):
        fails("none of the 1 image can be read; name a folder", *args, tmp_path / "bad", "-o", tmp_path / "no")


def test_train_words_tells_the_variance_that_is_kept(world: Path, tmp_path: Path) -> None:
    args = ("--size", 2, "--image-size", 16, "--components", 3)
    result = done("train-words", world / "runs", "-o", tmp_path / "w.npz", *args)
    assert re.search(r"3 components keep \d+\.\d % of the variance", result.stderr)
    assert result.stdout == ""


def test_describe_writes_arrays(world: Path, tmp_path: Path) -> None:
    done("describe", world / "runs", "-o", tmp_path / "d.npz", "--image-size", 16)
    with np.load(tmp_path / "d.npz", allow_pickle=False) as arrays:
        assert arrays["descriptors"].shape == (24, 384)
        assert arrays["descriptors"].dtype == np.float32
        assert arrays["sequences"].tolist() == ["seq1"] * 12 + ["seq2"] * 12
        assert arrays["frames"].shape == (24,)


def test_centrist_words_go_all_the_way(world: Path, tmp_path: Path) -> None:
    words, tokens, model = (tmp_path / name for name in ("w.npz", "tokens", "model"))
    args = ("--descriptor", "centrist", "--image-size", 16)
    done("train-words", world / "runs/seq1", "-o", words, "--size", 2, *args)
    done("tokenize", world / "runs", "-w", words, "-o", tokens)
    done("train-lm", tokens / "seq1.tsv", "-o", model)
    assert (
        done("decode", world / "runs/seq2", "-m", model, "-w", words, "-q").stdout
        == done("decode", tokens / "seq2.tsv", "-m", model, "-q").stdout
    )
    recognizer = load_recognizer(model, dictionary=DictionarySet.load(words))
    frame = sorted((world / "runs/seq2/std_cam").iterdir())[0]
    assert recognizer.update(read_gray(frame)).word == read_stream(tokens / "seq2.tsv").words[0]
    done("describe", world / "runs", "-o", tmp_path / "d.npz", *args)
    with np.load(tmp_path / "d.npz", allow_pickle=False) as arrays:
        assert arrays["descriptors"].shape == (24, 1016)


def test_a_matrix_goes_all_the_way(world: Path, tmp_path: Path) -> None:
    matrix = tmp_path / "a:b.npy"
    np.save(matrix, np.random.default_rng(0).normal(size=(24, 6)))
    given = ("--descriptor", f"npy:{matrix}")
    words, tokens, model = (tmp_path / name for name in ("w.npz", "tokens", "model"))
    done("train-words", world / "runs", "-o", words, "--size", 2, *given)
    done("tokenize", world / "runs", "-w", words, "-o", tokens, *given)
    done("train-lm", tokens, "-o", model)
    assert len(done("decode", tokens / "seq2.tsv", "-m", model).stdout.splitlines()) == 13
    way_out = "images cannot be described so here; tokenize with --descriptor npy:FILE, and decode the token streams"
    no = ("-o", tmp_path / "no")
    fails(way_out, "decode", world / "runs/seq2", "-m", model, "-w", words)
    fails(way_out, "tokenize", world / "runs", "-w", words, *no)
    fails("24 rows, and the sources have 12 frames", "tokenize", world / "runs/seq1", "-w", words, *no, *given)
    fails(
        "not wanted, for the dictionary is of gist", "tokenize", world / "runs", "-w", world / "words.npz", *no, *given
    )
    fails(r"none\.npy: no such file", "describe", world / "runs", *no, "--descriptor", f"npy:{tmp_path / 'none.npy'}")
    # With their names beside them, the rows of any of the sequences can be taken.
    done("describe", world / "runs", "-o", tmp_path / "d.npz", *given)
    one = ("--descriptor", f"npy:{tmp_path / 'd.npz'}")
    done("tokenize", world / "runs/seq1", "-w", words, "-o", tmp_path / "one", *one)
    assert (tmp_path / "one/seq1.tsv").read_bytes() == (tokens / "seq1.tsv").read_bytes()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--descriptor", "sift"),
            "'sift' is not one of gist, lbp, ranks, centrist, colour, onnx:FILE",
        ),
        (
            ("--descriptor", "npy:"),
            "'npy:' is not one of gist, lbp, ranks, centrist, colour, onnx:FILE",
        ),
        (
            ("--descriptor", "npy"),
            "'npy' is not one of gist, lbp, ranks, centrist, colour, onnx:FILE",
        ),
        (("--descriptor", "centrist", "--variant", "lmgist"), "--variant says nothing about centrist descriptors"),
        (
            ("--descriptor", "npy:a.npy", "--image-size", 64),
            "--image-size says nothing about npy descriptors",
        ),
    ],
)
def test_descriptors_and_settings_that_do_not_exist(world: Path, options: tuple[object, ...], message: str) -> None:
    for command in ("describe", "train-words"):
        misused(message, command, world / "runs", "-o", world / "no", *options)


def test_a_dictionary_knows_its_descriptor(world: Path) -> None:
    words = ("-w", world / "words.npz", "-o", world / "no")
    misused("'gist' is not one of npy:FILE", "tokenize", world / "runs", *words, "--descriptor", "gist")


def test_broken_dictionaries_are_named(world: Path, tmp_path: Path) -> None:
    whole = (world / "words.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.npz").write_text("garbage")
    for name, message in (
        ("cut.npz", "it is not an npz file, or it is truncated; make it again with `placerec train-words`"),
        ("text.npz", "it is not an npz file, or it is truncated; make it again with `placerec train-words`"),
        ("nothing.npz", "no such file; name another"),
    ):
        message = re.escape(f"{name}: {message}")
        fails(message, "tokenize", world / "runs", "-w", tmp_path / name, "-o", tmp_path / "no")
        fails(message, "decode", world / "runs/seq1", "-w", tmp_path / name, "-m", world / "seen-model")


def test_names_of_sequences_that_stay_equal_are_refused(world: Path, tmp_path: Path) -> None:
    for name in ("a/run", "b/run", "c/a/run"):
        write_images(tmp_path / name, frames=2)
    into = ("-w", world / "words.npz", "-o", tmp_path / "tokens")
    done("tokenize", tmp_path / "a/run", tmp_path / "b/run", *into)
    assert {"a-run.tsv", "b-run.tsv"} <= {path.name for path in (tmp_path / "tokens").iterdir()}
    fails("c/a/run: is named a-run, as .*a/run is; rename one of them", "tokenize", tmp_path / "a/run",
          tmp_path / "c/a/run", *into)  # fmt: skip
