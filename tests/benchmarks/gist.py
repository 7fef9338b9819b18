"""Images a second of gist(), beside a plain scipy.fft program, and by two processes as `describe --jobs 2` has them.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/gist.py [TURNS]

The plain program holds all 24 filters in memory and transforms them at once in float32. The images are synthetic
(blurred noise): the time does not depend on what they show. The first three columns are of CPU time, the others of
wall time, which wants an idle machine: `jobs.workers(1)` and `workers(2)` on the same batches, from the first answer to
the last, so that the half second in which processes start is not counted. Medians over the turns.
"""

import statistics
import sys
import time
from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from placerec.jobs import Executor, workers
from placerec.vision import gist

IMAGES = {64: 120, 128: 60, 256: 16}  # per turn, and per batch
BATCHES = 15
Image = NDArray[np.uint8]
Floats = NDArray[np.float32]


def plain(size: int, variant: str) -> Callable[[Image], Floats]:
    """The same descriptor in a dozen lines, for square images whose side is a multiple of four."""
    border = 32 if variant == "lmgist" else 0
    n = size + 2 * border
    f = np.fft.fftfreq(n, 1 / n)
    radius, angle = np.hypot(f, f[:, None]) / n, np.arctan2(f[:, None], f)
    tau = [np.where(angle + turn > np.pi, angle + turn - 2 * np.pi, angle + turn) for turn in np.pi * np.arange(6) / 6]
    radial = [-3.5 * (radius / (0.3 / 1.85**scale) - 1) ** 2 for scale in range(4)]
    bank = np.array([np.exp(r - 2 * np.pi * 0.5625 * t**2) for r in radial for t in tau], np.float32)
    falloff = np.exp(-(np.fft.fftfreq(size + 10, 1 / (size + 10)) ** 2) * np.log(2) / 16)
    low = np.outer(falloff, falloff).astype(np.float32)

    def smooth(x: Floats) -> Floats:
        smoothed: Floats = scipy.fft.ifft2(scipy.fft.fft2(x) * low).real
        return smoothed

    def describe(image: Image) -> Floats:
        x: Floats = image.astype(np.float32)
        if variant == "lmgist":
            x = 255 * (x - x.min()) / (x.max() - x.min())
        x = np.pad(np.log(x + 1), 5, "symmetric")
        x -= smooth(x)
        whitened = x / (0.2 + np.sqrt(np.abs(smooth(x * x))))
        spectrum = scipy.fft.fft2(np.pad(whitened[5:-5, 5:-5], border, "symmetric"))
        z = np.abs(scipy.fft.ifft2(spectrum * bank, overwrite_x=True))[:, border : n - border, border : n - border]
        means: Floats = z.reshape(24, 4, size // 4, 4, size // 4).mean(axis=(2, 4), dtype=np.float32)
        return means.transpose(0, 2, 1).ravel()

    return describe


def rate(work: Callable[[], object], images: int) -> float:
    """Images a second of CPU time."""
    start = time.process_time()
    work()
    return images / (time.process_time() - start)


def describe_all(variant: str, images: list[Image]) -> int:
    """What a worker does with a batch."""
    return len([gist(image, variant) for image in images])


def flow(work: Executor, variant: str, images: list[Image]) -> float:
    """Images a second, from the first batch's answer to the last's."""
    answers = work(partial(describe_all, variant), [images] * BATCHES)
    next(answers)
    start = time.perf_counter()
    return sum(answers) / (time.perf_counter() - start)


def measure(size: int, variant: str, turns: int) -> list[tuple[float, ...]]:
    """Per turn the images a second: the plain program's and gist()'s of CPU time, gist()'s by one and two processes."""
    rng = np.random.default_rng(size)
    noise = [rng.integers(0, 256, (size, size), dtype=np.uint8) for _ in range(IMAGES[size])]
    images = [np.asarray(cv2.GaussianBlur(image, (0, 0), 2), np.uint8) for image in noise]
    slow = plain(size, variant)

    def ours(image: Image) -> Floats:
        return gist(image, variant)

    difference = max(float(np.abs(ours(image) - slow(image)).max() / slow(image).max()) for image in images[:5])
    if difference > 1e-4:
        sys.exit(f"{variant} at {size} pixels: the two programs differ by {difference:.1e} of the largest element")

    def turn() -> tuple[float, ...]:
        n = len(images)
        return (
            rate(lambda: [slow(image) for image in images], n),
            rate(lambda: [ours(image) for image in images], n),
            flow(workers(1), variant, images),
            flow(workers(2), variant, images),
        )

    turn()
    return [turn() for _ in range(turns)]


def main(turns: int) -> None:
    """Print a table."""
    cv2.setNumThreads(1)
    print("pixels variant   scipy.fft   gist()   ratio   one process   two processes   ratio")
    for size in IMAGES:
        for variant in ("classic", "lmgist"):
            results = measure(size, variant, turns)
            slow, ours, one, two = (statistics.median(column) for column in zip(*results, strict=True))
            gain = statistics.median(b / a for a, b, _, _ in results)
            more = statistics.median(b / a for _, _, a, b in results)
            print(f"{size:6} {variant:8} {slow:10.0f} {ours:8.0f} {gain:7.2f}", end="")
            print(f" {one:13.0f} {two:15.0f} {more:7.2f}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 15)
