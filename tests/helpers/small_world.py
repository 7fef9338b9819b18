"""A small world for tests: three places, twelve words, two runs; and image sequences of noise that has structure."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.hohmm import Beliefs
from placerec.model import ModelOptions, train_lm
from placerec.words import WordStream, write_stream, write_vocabulary

PLACES = ("hall", "kitchen", "office")
VOCABULARY = tuple(f"w{i:02d}" for i in range(12))


def run_through(name: str, seed: int, frames: int = 60) -> WordStream:
    """A run with two visits to each place; a place has five words of its own, in runs, and a few strays."""
    rng = np.random.default_rng(seed)
    places = [PLACES[i * 6 // frames % 3] for i in range(frames)]
    words: list[str] = []
    for place in places:
        own = PLACES.index(place) * 3 + rng.integers(5)
        stray = rng.integers(len(VOCABULARY))
        again = words and rng.random() < 0.4
        words.append(words[-1] if again else VOCABULARY[stray if rng.random() < 0.1 else own])
    return WordStream.of(name, words, places, times=np.arange(frames) / 2)


def with_columns(stream: WordStream, **columns: Any) -> WordStream:
    """The stream with other places, times, frames or distances."""
    kept = {"places": stream.places, "times": stream.times, "frames": stream.frames, "distances": stream.distances}
    return WordStream.of(stream.name, stream.words, **(kept | columns))


def beliefs_of(
    name: str,
    places: Sequence[str],
    truth: Sequence[str],
    best: Sequence[str],
    belief: NDArray[np.float64] | None = None,
    times: NDArray[np.float64] | None = None,
) -> Beliefs:
    """What was decided about frames of one word, all of them selected; beliefs are uniform if left out."""
    stream = WordStream.of(name, ["w0"] * len(truth), truth, times=times)
    if belief is None:
        belief = np.full((len(truth), len(places)), 1 / len(places))
    return Beliefs(stream, tuple(places), np.ones(len(truth), bool), tuple(best), belief)


def write_tokens(folder: Path, names: Sequence[str] = ("run1", "run2", "run3")) -> Path:
    """A folder as `placerec tokenize` writes it, without tokens.json."""
    for seed, name in enumerate(names):
        write_stream(run_through(name, seed), folder / f"{name}.tsv")
    write_vocabulary(VOCABULARY, folder / "vocab.txt")
    return folder


def write_world(root: Path, names: Sequence[str] = ("run1", "run2", "run3"), **options: Any) -> Path:
    """`root` with the tokens of some runs, and a model, made with these options, of run1 and run2."""
    tokens = write_tokens(root / "tokens", names)
    train_lm(
        [tokens / "run1.tsv", tokens / "run2.tsv"], root / "model", options=ModelOptions(**options), as_in_paper=True
    )
    return root


def write_images(folder: Path, seed: int = 0, frames: int = 12) -> Path:
    """A sequence of COLD's layout: two places, gratings of another angle in each."""
    rng = np.random.default_rng(seed)
    (folder / "std_cam").mkdir(parents=True)
    (folder / "localization").mkdir()
    y, x = np.mgrid[:24, :32]
    labels = []
    for i in range(frames):
        place = "hall" if i < frames // 2 else "kitchen"
        wave = np.sin((x if place == "hall" else y) * (0.5 + rng.random()))
        name = f"t{1000 + i}.000000_x0.000000_y0.000000_a0.000000.png"
        picture = (127 + 90 * wave + rng.normal(0, 8, wave.shape)).clip(0, 255).astype(np.uint8)
        assert cv2.imwrite(str(folder / "std_cam" / name), picture)
        labels.append(f"{name} {place}\n")
    (folder / "localization" / "places.lst").write_text("".join(labels), encoding="utf-8")
    return folder


def write_coloured(folder: Path, seed: int = 0, frames: int = 16) -> Path:
    """A sequence of COLD's layout: two places of the same grey levels, that only the colours of patches tell apart."""
    write_images(folder, seed, frames)
    rng = np.random.default_rng([seed, 1])
    for number, path in enumerate(sorted((folder / "std_cam").iterdir())):
        y, x = np.mgrid[:24, :32]
        waves = 40 * np.sin(x * (0.5 + rng.random())) + rng.normal(0, 6, y.shape)
        warm = (x < 16) ^ (y < 12) if number < frames // 2 else x < 16
        # Of the luma 0.
        tint = np.where(warm[..., None], (-60, -19, 60), (60, 19, -60))
        picture = (127 + waves[..., None] + tint).clip(0, 255).astype(np.uint8)
        assert cv2.imwrite(str(path), picture)
    return folder
