"""Videos, bags and lists where images are asked for, as a user types it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.recordings import START, STEP, compressed, cut, raw, write_bag, write_video
from helpers.small_world import write_images
from helpers.typed_commands import SMALL, done, fails, misused, placerec

from placerec.frames import read_gray
from placerec.hohmm import read_beliefs
from placerec.words import WordStream, read_stream

LABELS = "0 0.6 hall\n0.6 1.2 kitchen\n"


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same two runs as images (images/), videos (videos/), and the first as a bag (bags/); words and models."""
    root = tmp_path_factory.mktemp("world")
    for seed in (1, 2):
        folder = write_images(root / f"images/seq{seed}", seed)
        files = sorted((folder / "std_cam").iterdir())
        shown = [np.repeat(read_gray(file)[..., None].astype(np.uint8), 3, axis=2) for file in files]
        write_video(root / f"videos/seq{seed}.avi", "FFV1", shown)
        (root / f"videos/seq{seed}.labels").write_text(LABELS)
        messages = [compressed(file.read_bytes(), START + i * STEP, "png") for i, file in enumerate(files)]
        write_bag(root / f"bags/seq{seed}", {"/camera": messages})
        (root / f"bags/seq{seed}.labels").write_text(LABELS)
    done("train-words", root / "images", "-o", root / "words.npz", *SMALL)
    done("tokenize", root / "images", "-w", root / "words.npz", "-o", root / "tokens", "-q")
    done("train-lm", root / "tokens", "-o", root / "model", "-q")
    return root


def tokens(world: Path, out: Path, *args: object, stdin: str | None = None) -> dict[str, WordStream]:
    done("tokenize", *args, "-w", world / "words.npz", "-o", out, "-q", stdin=stdin)
    return {path.stem: read_stream(path) for path in sorted(out.glob("*.tsv"))}


def test_tokens_of_bags_and_videos_are_those_of_the_images(world: Path, tmp_path: Path) -> None:
    images = tokens(world, tmp_path / "i", world / "images")
    bags = tokens(world, tmp_path / "b", world / "bags")
    videos = tokens(world, tmp_path / "v", world / "videos", "--jobs", 2)
    assert list(images) == list(bags) == list(videos) == ["seq1", "seq2"]
    for name, stream in images.items():
        assert bags[name].words == stream.words
        assert bags[name].places == videos[name].places == stream.places == ("hall",) * 6 + ("kitchen",) * 6
        assert np.allclose(bags[name].times, START / 1e9 + np.arange(12) / 10, atol=1e-6)
        assert np.allclose(videos[name].times, np.arange(12) / 10)
        # OpenCV writes colours that are rounded, so that a level may be another.
        assert np.mean([a == b for a, b in zip(videos[name].words, stream.words, strict=True)]) > 0.8
        assert videos[name].frames == tuple(f"{i:06d}" for i in range(12))


def test_options_of_recordings(world: Path, tmp_path: Path) -> None:
    (tmp_path / "other").write_text("0 0.3 office\n")
    video = world / "videos/seq1.avi"
    (stream,) = tokens(world, tmp_path / "a", video, "--every", 5, "--labels", tmp_path / "other").values()
    assert (stream.frames, stream.places) == (("000000", "000005", "000010"), ("office", "", ""))
    two = {"/a": [raw(np.zeros((16, 16), np.uint8), "mono8")], "/b": [raw(np.eye(16, dtype=np.uint8), "mono8")]}
    bag = write_bag(tmp_path / "two", two)
    words = ("-w", world / "words.npz")
    fails(r"two: has several topics of images: /a, /b; choose one", "tokenize", bag, *words, "-o", tmp_path / "n")
    assert list(tokens(world, tmp_path / "b", bag, "--topic", "/b")) == ["two"]
    misused("nowhere", "tokenize", video, *words, "-o", tmp_path / "n", "--labels", tmp_path / "nowhere")
    misused("0 is not in the range x>=1", "tokenize", video, *words, "-o", tmp_path / "n", "--every", 0)
    fails(
        "other: is one file for several recordings",
        *("tokenize", world / "videos", *words, "-o", tmp_path / "n", "--labels", tmp_path / "other"),
    )


@pytest.mark.parametrize("kind", ["images", "bags", "videos"])
def test_one_recording_is_cut_into_training_and_test(world: Path, tmp_path: Path, kind: str) -> None:
    (source,) = [path for path in (world / kind).glob("seq1*") if path.suffix != ".labels"]
    # Images of this layout have times of their own, which --rate leaves alone.
    whole = tokens(world, tmp_path / "w", source, "--rate", 10)["seq1"]
    half = float(whole.times[6] - whole.times[0])
    early = tokens(world, tmp_path / "e", source, "--rate", 10, "--to", half)["seq1"]
    late = tokens(world, tmp_path / "l", source, "--rate", 10, "--from", half)["seq1"]
    for stream, part in ((early, slice(0, 6)), (late, slice(6, None))):
        assert stream.words == whole.words[part]
        assert stream.frames == whole.frames[part]
        assert stream.places == whole.places[part]
        assert np.array_equal(stream.times, whole.times[part])
    words = ("-w", world / "words.npz", "-o", tmp_path / "n")
    misused("from 2 to 1 seconds is no part of a run", "tokenize", source, *words, "--from", 2, "--to", 1)
    fails("has no frame from second 900; choose another part", "tokenize", source, *words, "--from", 900)


def test_a_list_on_standard_input(world: Path, tmp_path: Path) -> None:
    files = sorted((world / "images/seq1/std_cam").iterdir())
    given = "".join(f"{file}\t{i}\t{'hall' if i < 6 else 'kitchen'}\n" for i, file in enumerate(files))
    (stream,) = tokens(world, tmp_path / "t", "-", stdin=given).values()
    expected = read_stream(world / "tokens/seq1.tsv")
    assert (stream.name, stream.words, stream.places) == ("stdin", expected.words, expected.places)
    assert stream.frames == tuple(map(str, files))
    described = done("describe", "-", "-o", tmp_path / "d.npz", stdin=given)
    assert "12 frames described\n" in described.stderr
    beliefs = done("decode", "-", "-w", world / "words.npz", "-m", world / "model", "-q", stdin=given).stdout
    assert len(beliefs.splitlines()) == 13
    result = placerec("tokenize", "-", "-w", world / "words.npz", "-o", tmp_path / "n", stdin="a.png\tx\n")
    assert result.exit_code == 1
    assert result.stderr == "placerec: <stdin>:1: 'x' is not a number of seconds; mend it\n"
    assert not (tmp_path / "n").exists()


def test_decode_finds_places_in_a_video(world: Path, tmp_path: Path) -> None:
    args = ("-w", world / "words.npz", "-m", world / "model", "-o", tmp_path / "beliefs", "-q")
    done("decode", world / "videos/seq2.avi", world / "bags/seq1", *args)
    for name in ("seq2", "seq1"):
        beliefs = read_beliefs(tmp_path / f"beliefs/{name}.tsv")
        assert len(beliefs.frames) == 12
        assert {"hall", "kitchen"} == set(beliefs.best)


def test_a_truncated_video_is_told_of_and_read_as_far_as_it_goes(world: Path, tmp_path: Path) -> None:
    short = cut(world / "videos/seq1.avi", 0.6, "short.avi")
    args = ("-w", world / "words.npz", "-o", tmp_path / "t")
    result = done("tokenize", short, *args)
    short.unlink()
    count = len(read_stream(tmp_path / "t/short.tsv").words)
    assert 2 < count < 11
    (listed,) = re.findall(rf"warning: {short}: is truncated or damaged: (\d+) frames up to second 0\.", result.stderr)
    # The frame that is cut is not listed by every OpenCV.
    skipped = int(listed) - count
    assert skipped in (0, 1)
    assert (
        result.stderr.count(f"warning: {short}: frame {count:06d} cannot be decoded; the frame is skipped") == skipped
    )
    assert f"{count} frames described{f', {skipped} skipped' * skipped}\n" in result.stderr


def test_words_and_stability_are_shown_of_videos_and_bags(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    shown = done("show-words", world / "words.npz", world / "bags", "-o", tmp_path / "words.png", "--json", "-q")
    assert json.loads(shown.stdout)["frames"] == 24
    assert (tmp_path / "words.png").stat().st_size > 10_000
    videos, words = world / "videos", ("-w", world / "words.npz")
    stable = json.loads(done("stability", videos / "seq1.avi", *words, "--json", "-q").stdout)
    assert stable["frames"] == 12
    image = min((world / "images/seq1/std_cam").iterdir())
    seen = done("show-frame", image, videos, *words, "-o", tmp_path / "seen.png", "-q")
    assert "mostly" in seen.stdout


def test_methods_are_compared_on_videos(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    videos = world / "videos"
    args = ("--methods", "hohmm,majority,naive-bayes", "--size", 2, "-o", tmp_path / "out", "-q")
    done("compare", videos, "--test", videos / "seq2.avi", *args)
    assert len((tmp_path / "out/methods.csv").read_text().splitlines()) == 4
    assert [path.name for path in (tmp_path / "out/beliefs/hohmm").glob("*.tsv")] == ["seq2.tsv"]
    kept = {path.name for path in (tmp_path / "out/cache").glob("descriptors-*")}
    done("compare", videos, "--test", videos / "seq2.avi", *args)
    assert {path.name for path in (tmp_path / "out/cache").glob("descriptors-*")} == kept
    fails(
        "is one file, and training and test are several recordings",
        *("compare", videos / "seq1.avi", "--test", videos / "seq2.avi", "--labels", videos / "seq1.labels", *args),
    )


def test_an_experiment_on_videos(world: Path, tmp_path: Path) -> None:
    config = tmp_path / "grid.toml"
    config.write_text(
        f'[data]\nsequences = ["{world}/videos/*"]\ntest = ["seq2"]\n'
        '[grid]\norder = [1]\nsmoothing = ["witten-bell"]\nselect = ["none"]\nsize = [2]\nseeds = 1\n'
    )
    done("experiment", config, "-o", tmp_path / "results", "--jobs", 1, "-q")
    assert len((tmp_path / "results/results.csv").read_text().splitlines()) == 2


def test_every_command_that_takes_a_source_says_what_it_can_be() -> None:
    for command in ("describe", "train-words", "tokenize", "decode", "compare"):
        text = " ".join(done(command, "--help").stdout.split())
        assert "video" in text, command
        assert "bags" in text or "bag of ROS" in text, command
        for option in ("--every", "--topic", "--labels", "--label-clock", "--camera", "--from", "--to", "--rate"):
            assert option in text
