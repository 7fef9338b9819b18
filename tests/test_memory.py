"""Memory does not grow with the frames but for their names, times and places; `benchmarks/memory.py` has the peaks."""

import tracemalloc
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import VOCABULARY, run_through, write_images
from numpy.typing import NDArray

from placerec.frames import find_sequences
from placerec.frames.table import Labels
from placerec.jobs import workers
from placerec.lm import stored_text
from placerec.model import train_lm
from placerec.vision import (
    DescriptorSpec,
    Dictionary,
    DictionaryOptions,
    DictionarySet,
    DictionarySetOptions,
    chunks,
    describe_sources,
    train_dictionary,
)
from placerec.words import write_stream, write_vocabulary
from placerec.words.tokenize import tokenize

SPEC = DescriptorSpec(image_size=8)
FEW, MANY = 200, 1200


def peak(work: Callable[[], object]) -> int:
    """Bytes that Python and numpy held at most while `work` was done."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    for frames in (FEW, MANY):
        write_images(root / str(frames), frames=20)
        images = sorted((root / str(frames) / "std_cam").iterdir())
        for number in range(20, frames):
            (images[0].parent / f"t{1000 + number}.000000_x0.000000_y0.000000_a0.000000.png").hardlink_to(
                images[number % 20]
            )
    train_dictionary([root / str(FEW)], root / "words.npz", spec=SPEC, options=DictionaryOptions(size=2, epochs=2))
    return root


@pytest.mark.parametrize("command", ["describe", "tokenize"])
def test_frames_take_little(world: Path, tmp_path: Path, command: str) -> None:
    def work(frames: int) -> None:
        if command == "describe":
            describe_sources([world / str(frames)], tmp_path / "d.npz", spec=SPEC, work=workers(1))
        else:
            tokenize([world / str(frames)], world / "words.npz", tmp_path / "tokens", work=workers(1))

    work(FEW)
    few, many = (peak(partial(work, frames)) for frames in (FEW, MANY))
    # A descriptor has 1536 bytes; most of this goes to the labels, and is free again when the frames are listed.
    assert (many - few) / (MANY - FEW) < 450


def test_a_folder_is_listed_in_little_memory(world: Path) -> None:
    kept = []
    for frames in (FEW, MANY):
        tracemalloc.start()
        sequences = find_sequences([world / str(frames)])
        kept.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
        assert len(sequences[0].frames) == frames
    assert (kept[1] - kept[0]) / (MANY - FEW) < 100


def pieces(n: int) -> Callable[[], Iterator[NDArray[np.float32]]]:
    """Rows of 24 values, a thousand at a time."""

    def give() -> Iterator[NDArray[np.float32]]:
        for first in range(0, n, 1000):
            yield np.random.default_rng(first).random((min(1000, n - first), 24), np.float32)

    return give


def test_words_are_learned_from_a_stream_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """And they are the words that the same descriptors in memory give, to the byte."""
    monkeypatch.setattr(chunks, "IN_MEMORY", 1 << 16)
    spec = DescriptorSpec(kind="npy", columns=24)
    options = DictionarySetOptions(sizes=(2, 3), epochs=2)

    def fit(n: int) -> DictionarySet:
        places = Labels(("hall", "kitchen", "")[row % 3] for row in range(n))
        return DictionarySet.fit(pieces(n), spec=spec, places=places, options=options)

    fit(100)
    few, many = peak(lambda: fit(10_000)), peak(lambda: fit(100_000))
    assert (many - few) / 90_000 < 24, "the number of its place takes 8 bytes, and a row has 96"
    rows, places = np.concatenate(list(pieces(10_000)())), [("hall", "kitchen", "")[row % 3] for row in range(10_000)]
    whole = DictionarySet.fit(rows, spec=spec, places=places, options=options)
    assert fit(10_000).fingerprint == whole.fingerprint


def test_one_dictionary_takes_four_bytes_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "IN_MEMORY", 1 << 16)
    spec = DescriptorSpec(kind="npy", columns=24)

    def fit(n: int) -> Dictionary:
        return Dictionary.fit(pieces(n), spec=spec, options=DictionaryOptions(size=3, epochs=2))

    fit(100)
    few, many = peak(lambda: fit(10_000)), peak(lambda: fit(100_000))
    assert (many - few) / 90_000 < 12, "4 bytes are promised, and a row has 96"


def test_models_are_trained_in_bounded_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With text blocks and runs as small as the text is here."""
    monkeypatch.setattr(stored_text, "IN_MEMORY", 1 << 14)
    monkeypatch.setattr("placerec.lm.counts.BLOCK", 1 << 12)
    monkeypatch.setattr(stored_text, "BLOCK", 1 << 12)
    monkeypatch.setattr(stored_text, "WAITING", 1 << 12)
    for count in (10, 60):
        for number in range(count):
            write_stream(run_through(f"run{number}", number, 600), tmp_path / str(count) / f"run{number}.tsv")
        write_vocabulary(VOCABULARY, tmp_path / str(count) / "vocab.txt")
    few, many = (peak(partial(train_lm, [tmp_path / str(count)], tmp_path / "model")) for count in (10, 60))
    assert (many - few) / 30_000 < 10, "a word in a list of words takes more, and its line in a stream ten times that"
