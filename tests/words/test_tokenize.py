"""From images to token streams."""

import json
import logging
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images

from placerec.errors import OutputError, VisionError
from placerec.frames import find_sequences
from placerec.vision import DescriptorSpec, Dictionary, DictionaryOptions, describe
from placerec.words import read_stream, read_vocabulary
from placerec.words.tokenize import streams_of, tokenize, tokens_of


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    for seed, name in enumerate(("seq1", "seq2")):
        write_images(root / "runs" / name, seed)
    described = describe(find_sequences([root / "runs"]), DescriptorSpec(image_size=16))
    Dictionary.fit(described.values, spec=described.spec, options=DictionaryOptions(size=4)).save(root / "words.npz")
    return root


def test_each_sequence_becomes_a_stream(world: Path, tmp_path: Path) -> None:
    tokenize([world / "runs"], world / "words.npz", tmp_path / "tokens")
    names = sorted(path.name for path in (tmp_path / "tokens").iterdir())
    assert names == ["seq1.tsv", "seq2.tsv", "tokens.json", "vocab.txt"]
    stream = read_stream(tmp_path / "tokens/seq1.tsv")
    assert len(stream) == 12
    assert stream.places == ("hall",) * 6 + ("kitchen",) * 6
    assert stream.times.tolist() == [1000.0 + i for i in range(12)]
    assert stream.frames[0] == "t1000.000000_x0.000000_y0.000000_a0.000000.png"
    assert (stream.distances >= 0).all()


def test_words_are_those_of_the_dictionary(world: Path, tmp_path: Path) -> None:
    tokenize([world / "runs"], world / "words.npz", tmp_path / "tokens")
    dictionary = Dictionary.load(world / "words.npz")
    assert (
        read_vocabulary(tmp_path / "tokens/vocab.txt") == dictionary.vocabulary == tuple(f"w{i:02d}" for i in range(16))
    )
    described = describe(find_sequences([world / "runs/seq2"]), dictionary.spec)
    units, distances = dictionary.words(described.values)
    stream = read_stream(tmp_path / "tokens/seq2.tsv")
    assert stream.words == tuple(f"w{unit:02d}" for unit in units)
    np.testing.assert_allclose(stream.distances, distances, rtol=1e-5)
    fingerprint = json.loads((tmp_path / "tokens/tokens.json").read_text())["dictionary"]
    assert fingerprint == dictionary.fingerprint


def test_descriptors_of_another_kind_have_no_words(world: Path) -> None:
    dictionary = Dictionary.load(world / "words.npz")
    described = describe(find_sequences([world / "runs/seq2"]), DescriptorSpec(image_size=24))
    with pytest.raises(VisionError, match="the descriptors are of another kind"):
        tokens_of(described, dictionary)


def test_a_frame_has_one_word_whatever_is_tokenized_with_it(world: Path, tmp_path: Path) -> None:
    tokenize([world / "runs"], world / "words.npz", tmp_path / "both")
    tokenize([world / "runs/seq2"], world / "words.npz", tmp_path / "one")
    assert (tmp_path / "both/seq2.tsv").read_bytes() == (tmp_path / "one/seq2.tsv").read_bytes()


def test_frames_are_counted_and_unreadable_sequences_are_left_out(
    world: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_images(tmp_path / "runs/good", frames=3)
    (tmp_path / "runs/bad/std_cam").mkdir(parents=True)
    (tmp_path / "runs/bad/std_cam/a.png").write_text("no picture")
    with caplog.at_level(logging.INFO):
        streams = streams_of([tmp_path / "runs"], Dictionary.load(world / "words.npz"))
    assert [stream.name for stream in streams] == ["good"]
    assert "3 frames described, 1 skipped" in caplog.messages
    assert "bad: none of its images can be read; the sequence is left out" in caplog.messages


def test_progress_is_told(world: Path) -> None:
    steps: list[tuple[int, int]] = []
    streams_of(
        [world / "runs"], Dictionary.load(world / "words.npz"), progress=lambda done, total: steps.append((done, total))
    )
    assert steps == [(12, 24), (24, 24)]


def test_an_output_that_cannot_be_replaced_is_refused_before_any_image_is_read(
    world: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "photo.jpeg").write_text("mine")
    monkeypatch.setattr("placerec.words.tokenize.describe", lambda *args, **options: pytest.fail("an image was read"))
    with pytest.raises(OutputError, match=r"holds photo\.jpeg"):
        tokenize([world / "runs"], world / "words.npz", tmp_path)


def test_frames_of_a_matrix_become_words_and_no_image_is_read(world: Path, tmp_path: Path) -> None:
    rows = np.random.default_rng(0).normal(size=(24, 6)).astype(np.float32)
    np.save(tmp_path / "rows.npy", rows)
    dictionary = Dictionary.fit(rows, spec=DescriptorSpec(kind="npy", columns=6), options=DictionaryOptions(size=3))
    dictionary.save(tmp_path / "words.npz")
    write_images(tmp_path / "runs/seq1")
    write_images(tmp_path / "runs/seq2")
    for path in (tmp_path / "runs").rglob("*.png"):
        path.write_bytes(b"")
    tokenize([tmp_path / "runs"], tmp_path / "words.npz", tmp_path / "tokens", matrix=tmp_path / "rows.npy")
    units, _ = dictionary.words(rows)
    words = [*read_stream(tmp_path / "tokens/seq1.tsv").words, *read_stream(tmp_path / "tokens/seq2.tsv").words]
    assert words == [f"w{unit}" for unit in units]
    with pytest.raises(VisionError, match="tokenize with --descriptor npy:FILE, and decode the token streams"):
        streams_of([tmp_path / "runs"], dictionary)
    with pytest.raises(VisionError, match=r"rows\.npy: is not wanted, for the dictionary is of gist descriptors"):
        tokenize([world / "runs"], world / "words.npz", tmp_path / "no", matrix=tmp_path / "rows.npy")
    assert not (tmp_path / "no").exists()
