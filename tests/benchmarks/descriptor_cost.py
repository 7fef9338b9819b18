"""What each kind of descriptor costs beside GIST, the whole front end of the default, and OpenCV's bags of words.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/descriptor_cost.py [TURNS] [--frames SOURCE] [--network FILE]

For one image that is read already, fitting included. `us`: microseconds of CPU time, medians over all turns of one
process. `KB`: what numpy and Python hold at most while they describe one (OpenCV's own memory within a call is not
counted). `MB`: what the memory of a new process grows by when it describes the images, with filters, imports and the
network. `words` and `belief`: of the default's eight dictionaries and eight places, a frame at a time. A bag of
words: at most 500 points of OpenCV's ORB or SIFT, their nearest of 400 words, and the histogram of these. Without
--frames the images are synthetic (blurred noise, 320 x 180), which matters to ORB and SIFT alone.
"""

import argparse
import json
import logging
import multiprocessing
import statistics
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dictionaries import make_recognizer

from placerec import find_sequences
from placerec.frames import all_images
from placerec.frames.sequence import ColourImage
from placerec.vision import DEFAULT_KIND, KINDS, DescriptorSpec, descriptor
from placerec.vision.onnx import open_network

WIDTH, HEIGHT, IMAGES = 320, 180, 24
POINTS, WORDS = 500, 400
Describe = Callable[[ColourImage], Any]


def make_images() -> list[ColourImage]:
    """Pictures of the size of the real sets, in colours."""
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8) for _ in range(IMAGES)]
    blurred = [np.asarray(cv2.GaussianBlur(one, (0, 0), 2), np.uint8) for one in noise]
    return [ColourImage(np.asarray(cv2.cvtColor(one, cv2.COLOR_BGR2GRAY), np.uint8), one) for one in blurred]


def some_images(source: Path) -> list[ColourImage]:
    """Frames from all over a source."""
    frames = [(one, number) for one in find_sequences([source]) for number in range(len(one.frames))]
    taken = [frames[k] for k in np.linspace(0, len(frames) - 1, IMAGES).astype(int)]
    found = []
    for sequence in dict.fromkeys(one for one, _ in taken):
        numbers = {number for one, number in taken if one is sequence}
        images = (image for k, (_, image) in enumerate(all_images(sequence, colours=True)) if k in numbers)
        found += [image for image in images if isinstance(image, ColourImage)]
    return found


def bag_of_words(kind: str) -> Describe:
    """OpenCV's points of interest, each the nearest of random words: what the words are does not change the time."""
    rng = np.random.default_rng(0)
    finder: Any = getattr(cv2, f"{kind}_create")(nfeatures=POINTS)
    binary = kind == "ORB"
    words: Any = rng.integers(0, 256, (WORDS, finder.descriptorSize())).astype(np.uint8 if binary else np.float32)
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING if binary else cv2.NORM_L2)

    def describe(image: ColourImage) -> np.ndarray:
        _, found = finder.detectAndCompute(image.gray, None)
        nearest = [] if found is None else [one.trainIdx for one in matcher.match(found, words)]
        return np.bincount(np.array(nearest, np.int64), minlength=WORDS) / max(len(nearest), 1)

    return describe


def front_end(folder: Path) -> dict[str, Describe]:
    """The words of the default's dictionaries, the belief, and all that is done with an image that is read."""
    dictionaries, recognizer, _ = make_recognizer(folder, DescriptorSpec(kind=DEFAULT_KIND))
    row = np.zeros((1, dictionaries.spec.length), np.float32)
    words = [one.vocabulary[0] for one in dictionaries.dictionaries]
    return {
        "words": lambda image: dictionaries.words(row),
        "belief": lambda image: recognizer.answer(words),
        "front end": lambda image: recognizer.answer(list(dictionaries.words_of(image)[0])),
    }


def microseconds(ways: dict[str, Describe], images: Sequence[ColourImage], turns: int) -> dict[str, float]:
    """The median CPU time of each way for an image; the ways take turns, each time in another order."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    rng = np.random.default_rng(0)
    for image in list(images) * turns:
        for name in rng.permutation([*ways]).tolist():
            started = time.thread_time()
            ways[name](image)
            spent[name].append(1e6 * (time.thread_time() - started))
    return {name: statistics.median(times) for name, times in spent.items()}


def kilobytes(describe: Describe, image: ColourImage) -> float:
    """The most that numpy and Python hold for an image, beyond what they hold before."""
    describe(image)
    tracemalloc.start()
    describe(image)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return most / 1024


def megabytes(spec: DescriptorSpec, images: Sequence[ColourImage]) -> float:
    """What the memory of this process, which should be a new one, grows by at most (Linux)."""
    cv2.setNumThreads(1)
    Path("/proc/self/clear_refs").write_text("5")  # the peak is what is there now
    before = _peak()
    for image in images:
        descriptor(image, spec)
    return _peak() - before


def _peak() -> float:
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def measured(images: Sequence[ColourImage], network: str | None, turns: int) -> list[dict[str, str]]:
    """A line for each way."""
    specs = {kind: DescriptorSpec(kind=kind) for kind, one in KINDS.items() if one.describe and kind != "onnx"}
    specs[DEFAULT_KIND] = DescriptorSpec(kind=DEFAULT_KIND)
    if network:
        file, _, layer = network.partition("#")
        specs["onnx"] = DescriptorSpec(kind="onnx", network=open_network(file, layer))
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), max_tasks_per_child=1) as work:
        grown = dict(zip(specs, work.map(partial(megabytes, images=images), specs.values()), strict=True))
    ways: dict[str, Describe] = {kind: partial(descriptor, spec=spec) for kind, spec in specs.items()}
    with tempfile.TemporaryDirectory() as folder:
        ways |= front_end(Path(folder)) | {f"{kind}, bag of words": bag_of_words(kind) for kind in ("ORB", "SIFT")}
        times = microseconds(ways, images, turns)
        return [
            {
                "": name,
                "values": str(specs[name].length) if name in specs else "",
                "us": f"{times[name]:.0f}",
                "/ GIST": f"{times[name] / times['gist']:.3f}",
                "KB": f"{kilobytes(describe, images[0]):.0f}",
                "MB": f"{grown[name]:.1f}" if name in grown else "",
            }
            for name, describe in ways.items()
        ]


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("turns", nargs="?", type=int, default=10)
    parser.add_argument("--frames", metavar="SOURCE", type=Path)
    parser.add_argument("--network", metavar="FILE[#LAYER]")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    logging.disable()
    images = some_images(options.frames) if options.frames else make_images()
    lines = measured(images, options.network, options.turns)
    if options.json:
        print(json.dumps(lines))
        return
    for line in [dict(zip(lines[0], lines[0], strict=True)), *lines]:
        name, *numbers = line.values()
        print(f"{name:22}" + "".join(f"{number:>10}" for number in numbers))


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main()
