"""What words and beliefs of several dictionaries cost beside GIST: four of GIST alone, and the eight of the default.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/dictionaries.py [TURNS]

`one by one`: each frame is described, looked up and answered in turn, as `decode --live` does. `together`: 64 frames
are looked up at a time, as `tokenize` does, and a sequence of 1000 in eight places is decoded as a whole. `other
descriptors`: those of the default beside GIST. Microseconds a frame, medians over all turns of one process, of CPU
time. The frames are synthetic (blurred noise): the time does not depend on what they show.
"""

import logging
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar, cast

import cv2
import numpy as np

from placerec.arrays import Singles
from placerec.frames.sequence import Gray
from placerec.frames.table import FrameTable
from placerec.hohmm import Recognizer
from placerec.model import load_recognizer, train_lm
from placerec.vision import DEFAULT_KIND, Descriptors, DescriptorSpec, DictionarySet, DictionarySetOptions, descriptor
from placerec.vision.gist import gist
from placerec.words import WordStream
from placerec.words.folder import write_tokens
from placerec.words.tokenize import tokens_of

T = TypeVar("T")
FRAMES, TOGETHER, PLACES, LENGTH = 24, 64, 8, 1000


def make_pictures() -> list[Gray]:
    """Pictures of the size that is described."""
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 256, (128, 128), dtype=np.uint8) for _ in range(FRAMES)]
    return [cast(Gray, cv2.GaussianBlur(one, (0, 0), 2)) for one in noise]


def make_run(name: str, seed: int, spec: DescriptorSpec) -> Descriptors:
    """Descriptors that lie about as those of images do, of a run through the places."""
    centres = np.random.default_rng(1).random((PLACES, 200, spec.length)) * 0.2
    rng = np.random.default_rng([2, seed])
    place = np.arange(LENGTH) * 2 * PLACES // LENGTH % PLACES
    rows = centres[place, rng.integers(200, size=LENGTH)] + 0.02 * rng.random((LENGTH, spec.length))
    table = FrameTable.of(name, [f"{number}.png" for number in range(LENGTH)], places=[f"place{one}" for one in place])
    return Descriptors(spec, rows.astype(np.float32), table)


def make_recognizer(folder: Path, spec: DescriptorSpec) -> tuple[DictionarySet, Recognizer, WordStream]:
    """What eight runs have trained, and the words of a ninth."""
    runs = [make_run(f"run{number}", number, spec) for number in range(8)]
    frames = Descriptors.concat(runs)
    options = DictionarySetOptions(epochs=4)
    dictionaries = DictionarySet.fit(frames.values, spec=frames.spec, places=frames.table.places, options=options)
    write_tokens(tokens_of(frames, dictionaries), dictionaries, folder / "tokens")
    train_lm([folder / "tokens"], folder / "model")
    return dictionaries, load_recognizer(folder / "model"), tokens_of(make_run("test", 9, spec), dictionaries)[0]


def seconds(function: Callable[[T], object], given: T) -> float:
    """The CPU time of one call."""
    start = time.thread_time()
    function(given)
    return time.thread_time() - start


def measured(
    pictures: list[Gray], dictionaries: DictionarySet, recognizer: Recognizer, test: WordStream, turns: int
) -> dict[str, list[float]]:
    """The seconds that each stage took for a frame, turn by turn."""
    others = dictionaries.spec.part(*dictionaries.spec.kinds[1:]) if dictionaries.spec.kinds[1:] else None
    rows = np.array([descriptor(picture, dictionaries.spec) for picture in pictures])
    batch: Singles = np.resize(rows, (TOGETHER, rows.shape[1]))
    found: dict[str, list[float]] = {name: [] for name in STAGES}
    vocabularies = [one.vocabulary for one in dictionaries.dictionaries]
    for _ in range(turns):
        for picture, row in zip(pictures, rows, strict=True):
            found["GIST"].append(seconds(gist, picture))
            if others is not None:
                found["other descriptors"].append(seconds(partial(descriptor, spec=others), picture))
            found["one by one: words"].append(seconds(dictionaries.words, row[None]))
            answer = dictionaries.words(row[None])
            words = [names[units[0]] for names, (units, _) in zip(vocabularies, answer, strict=True)]
            found["one by one: belief"].append(seconds(recognizer.answer, words))
        found["together: words"].append(seconds(dictionaries.words, batch) / TOGETHER)
        found["together: belief"].append(seconds(recognizer.decode, test) / LENGTH)
    return found


STAGES = ("GIST", "other descriptors", "one by one: words", "one by one: belief", "together: words", "together: belief")


def main(turns: int) -> None:
    """Print a line for each stage."""
    logging.disable()
    for spec in (DescriptorSpec(), DescriptorSpec(kind=DEFAULT_KIND)):
        with tempfile.TemporaryDirectory() as folder:
            made = make_recognizer(Path(folder), spec)
            found = measured(make_pictures(), *made, turns)
        medians = {name: statistics.median(times) for name, times in found.items() if times}
        print(f"{len(made[0].dictionaries)} dictionaries of {spec.kind}\n{'':20}{'us':>8}{'/ GIST':>10}")
        for name, median in medians.items():
            print(f"{name:20}{1e6 * median:8.1f}{median / medians['GIST']:10.4f}")


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
