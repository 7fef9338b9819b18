"""What one frame costs, stage by stage, as it is decoded live; each as a share of the time of GIST.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/live.py [TURNS]

The frames are synthetic (blurred noise, 640 x 480 in colour): the time does not depend on what they show. `picture`:
a JPEG of that size to grey levels; a camera's own frames are there already. `fit`: to the 128 x 128 that GIST
describes. `word`: PCA and the nearest unit. `belief`: five places, order 2. `line`: as `decode` writes it. The stages
take turns frame by frame in one process; medians over all turns, of CPU time.

Then the default's eight dictionaries (eight places) by `decode --live`: a video of these frames, 25 a second for ten
seconds, on one processor.
"""

import logging
import os
import statistics
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from dictionaries import make_recognizer as make_default
from numpy.typing import NDArray

from placerec.frames.image import read_gray
from placerec.hohmm import Recognizer
from placerec.methods import decode_live
from placerec.methods.decode import format_belief
from placerec.model import load_recognizer, train_lm
from placerec.vision import DEFAULT_KIND, Dictionary, DictionaryOptions
from placerec.vision.gist import gist
from placerec.vision.images import fit_image
from placerec.vision.spec import DescriptorSpec

FRAMES, PLACES, SIZES = 24, 5, (10, 20, 30)
RATE, SECONDS = 25, 10
STAGES = ("picture", "fit", "gist", "word", "belief", "line")


def write_frames(folder: Path) -> list[Path]:
    """Some frames as JPEG files."""
    rng = np.random.default_rng(0)
    paths = [folder / f"{number}.jpg" for number in range(FRAMES)]
    for path in paths:
        noise = rng.integers(0, 256, (480, 640, 3), dtype=np.uint8)
        cv2.imwrite(str(path), cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 4), np.empty(0), 0, 255, cv2.NORM_MINMAX))
    return paths


def make_dictionary(size: int) -> Dictionary:
    """A dictionary of descriptors that lie about as those of images do."""
    rng = np.random.default_rng(1)
    centres = rng.random((4 * size * size, 384)) * 0.2
    rows = centres[rng.integers(len(centres), size=20 * size * size)] + 0.02 * rng.random((20 * size * size, 384))
    return Dictionary.fit(
        rows.astype(np.float32), spec=DescriptorSpec(), options=DictionaryOptions(size=size, epochs=4)
    )


def make_recognizer(folder: Path, dictionary: Dictionary) -> Recognizer:
    """Five places, each of 2000 words of its own liking."""
    words, rng = np.array(dictionary.vocabulary), np.random.default_rng(2)
    (folder / "text").mkdir()
    for place in range(PLACES):
        likes = rng.dirichlet(np.full(len(words), 0.1))
        visits = [" ".join(rng.choice(words, 100, p=likes)) for _ in range(20)]
        (folder / f"text/place{place}.txt").write_text("\n".join(visits) + "\n")
    (folder / "vocab.txt").write_text("\n".join(words) + "\n")
    train_lm([folder / "text"], folder / "model", vocabulary=folder / "vocab.txt")
    return load_recognizer(folder / "model")


def stages(path: Path, dictionary: Dictionary, recognizer: Recognizer) -> list[float]:
    """The seconds that each stage takes for one frame."""
    clock = time.thread_time
    moments = [clock()]
    gray: NDArray[np.uint8 | np.float32] = read_gray(path)
    moments.append(clock())
    small = fit_image(gray, 128)
    moments.append(clock())
    descriptor = gist(small)
    moments.append(clock())
    (unit,), (distance,) = dictionary.words(descriptor[None])
    word = dictionary.vocabulary[unit]
    moments.append(clock())
    belief = recognizer.update(word, None, float(distance))
    moments.append(clock())
    format_belief(path.name, 0.0, "", belief, as_json=False)
    moments.append(clock())
    return [after - before for before, after in pairwise(moments)]


def write_video(path: Path, frames: list[Path]) -> None:
    """The frames over and over, as Motion JPEG."""
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE, (640, 480))
    for number in range(RATE * SECONDS):
        video.write(np.asarray(cv2.imread(str(frames[number % len(frames)])), np.uint8))
    video.release()


def live(folder: Path) -> None:
    """Print what `decode --live` says of a video at its own pace."""
    dictionaries, _, _ = make_default(folder, DescriptorSpec(kind=DEFAULT_KIND))
    dictionaries.save(folder / "words.npz")
    write_video(folder / "run.avi", write_frames(folder))
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    for _ in decode_live(folder / "run.avi", folder / "model", words=folder / "words.npz"):
        pass


def main(turns: int) -> None:
    """Print a table, and what came of live decoding."""
    print(f"{'':12}" + "".join(f"{stage:>10}" for stage in STAGES) + f"{'all':>10}")
    for size in SIZES:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            paths, dictionary = write_frames(folder), make_dictionary(size)
            recognizer = make_recognizer(folder, dictionary)
            for path in paths:
                stages(path, dictionary, recognizer)
            times = [stages(path, dictionary, recognizer) for _ in range(turns) for path in paths]
        medians = [statistics.median(column) for column in zip(*times, strict=True)]
        medians.append(sum(medians))
        print(f"{size * size:4} words  " + "".join(f"{1e6 * seconds:8.0f}us" for seconds in medians))
        print(f"{'':12}" + "".join(f"{seconds / medians[2]:10.4f}" for seconds in medians), flush=True)
    with tempfile.TemporaryDirectory() as name:
        live(Path(name))


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
