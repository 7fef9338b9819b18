"""What each kind of descriptor costs beside GIST, and all that the default's views need.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/descriptor_cost.py [TURNS]

Microseconds of CPU time for one image of 320 x 180 pixels that is read already, fitting included, medians over all
turns of one process. The images are synthetic (blurred noise): the time does not depend on what they show.
"""

import statistics
import sys
import time

import cv2
import numpy as np

from placerec.frames.sequence import ColourImage
from placerec.vision import DEFAULT_KIND, KINDS, DescriptorSpec, descriptor

WIDTH, HEIGHT, IMAGES = 320, 180, 8


def make_images() -> list[ColourImage]:
    """Pictures of the size of the real sets, in colours."""
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8) for _ in range(IMAGES)]
    blurred = [np.asarray(cv2.GaussianBlur(one, (0, 0), 2), np.uint8) for one in noise]
    return [ColourImage(np.asarray(cv2.cvtColor(one, cv2.COLOR_BGR2GRAY), np.uint8), one) for one in blurred]


def main(turns: int) -> None:
    """Print a line for each kind."""
    images = make_images()
    made = [kind for kind, one in KINDS.items() if one.describe is not None and kind != "onnx"]
    spent: dict[str, list[float]] = {kind: [] for kind in (*made, DEFAULT_KIND)}
    for _ in range(turns):
        for kind, times in spent.items():
            spec = DescriptorSpec(kind=kind)
            for image in images:
                started = time.thread_time()
                descriptor(image, spec)
                times.append(time.thread_time() - started)
    print(f"{'':18}{'us':>8}{'/ GIST':>10}")
    medians = {kind: statistics.median(times) for kind, times in spent.items()}
    for kind, median in medians.items():
        print(f"{kind:18}{1e6 * median:8.0f}{median / medians['gist']:10.3f}")


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
