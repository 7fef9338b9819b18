"""What the words of four dictionaries cost beside GIST: the default's two views of two sizes.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/dictionaries.py [TURNS]

`live`: frame by frame, each described and looked up in turn, as `decode --live` does. `batch`: 64 frames at a time, as
`tokenize` does. Microseconds a frame, medians over all turns of one process, of CPU time. The frames are synthetic
(blurred noise): the time does not depend on what they show.
"""

import statistics
import sys
import time
from collections.abc import Callable
from typing import TypeVar, cast

import cv2
import numpy as np

from placerec.frames.sequence import Gray
from placerec.vision import DescriptorSpec, DictionarySet, DictionarySetOptions
from placerec.vision.gist import gist

T = TypeVar("T")
FRAMES, TOGETHER = 24, 64


def make_pictures() -> list[Gray]:
    """Pictures of the size that is described."""
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 256, (128, 128), dtype=np.uint8) for _ in range(FRAMES)]
    return [cast(Gray, cv2.GaussianBlur(one, (0, 0), 2)) for one in noise]


def make_dictionaries() -> DictionarySet:
    """Dictionaries of descriptors that lie about as those of images do."""
    rng = np.random.default_rng(1)
    centres = rng.random((1600, 384)) * 0.2
    near = rng.integers(len(centres), size=8000)
    rows = (centres[near] + 0.02 * rng.random((8000, 384))).astype(np.float32)
    places = [f"place {number % 8}" for number in near.tolist()]
    return DictionarySet.fit(rows, spec=DescriptorSpec(), places=places, options=DictionarySetOptions(epochs=4))


def seconds(function: Callable[[T], object], given: T) -> float:
    """The CPU time of one call."""
    start = time.thread_time()
    function(given)
    return time.thread_time() - start


def main() -> None:
    """Print a line for each way of looking words up."""
    turns = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    pictures, dictionaries = make_pictures(), make_dictionaries()
    rows = np.array([gist(picture) for picture in pictures])
    batch = np.resize(rows, (TOGETHER, rows.shape[1]))
    described, live, together = [], [], []
    for _ in range(turns):
        for picture, row in zip(pictures, rows, strict=True):
            described.append(seconds(gist, picture))
            live.append(seconds(dictionaries.words, row[None]))
        together.append(seconds(dictionaries.words, batch) / TOGETHER)
    whole = statistics.median(described)
    print(f"{'':8}{'us':>8}{'/ GIST':>10}")
    for name, found in (("GIST", described), ("live", live), ("batch", together)):
        print(f"{name:8}{1e6 * statistics.median(found):8.1f}{statistics.median(found) / whole:10.4f}")


if __name__ == "__main__":
    main()
