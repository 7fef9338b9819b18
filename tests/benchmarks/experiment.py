"""What the 600 cells of the paper's grid cost, beside GIST of as many frames, in one run.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/experiment.py [SCALE]

Token streams of the paper's size (11 380 frames train in 12 sequences, 5 192 test in 6; SCALE takes a share of them),
for each of 2 map sizes and 5 seeds, are made from a seed: five places that prefer words of their own, in runs. GIST is
measured on 200 synthetic images of 128 pixels (its time does not depend on what they show), half before and half after
the grid, and extrapolated to all 16 572 frames. One process, one thread; CPU time, so that other work does not count.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from placerec.experiments.grid.run import experiment
from placerec.vision import gist
from placerec.words import WordStream, write_stream, write_vocabulary

TRAIN, TEST, PLACES = 11_380, 5_192, ("CR", "KT", "OF", "PA", "TL")
SIZES, SEEDS, IMAGES = (10, 20), 5, 100
CONFIG = """
[data]
tokens = "{size}-{seed}"
test = ["*3"]
[grid]
order = [1, 2, 3, 4, 5, 6]
smoothing = ["witten-bell", "lidstone-backoff"]
select = ["none", "subsample:3", "subsample:5", "compress:3", "unique"]
size = [10, 20]
seeds = 5
"""


def write_sequence(folder: Path, name: str, frames: int, size: int, rng: np.random.Generator) -> None:
    """Visits of 180 frames on the average; two of three words are the place's own, in runs of three."""
    names = [f"w{unit:0{len(str(size**2 - 1))}d}" for unit in range(size**2)]
    own = len(names) // len(PLACES)
    places: list[str] = []
    words: list[str] = []
    while len(words) < frames:
        place = int(rng.integers(len(PLACES)))
        for _ in range(int(rng.gamma(4, 15)) + 1):
            unit = place * own + min(int(rng.geometric(0.06)), own) - 1 if rng.random() < 0.67 else -1
            run = int(rng.geometric(1 / 3))
            words += [names[unit if unit >= 0 else int(rng.integers(len(names)))]] * run
            places += [PLACES[place]] * run
    stream = WordStream.of(name, words[:frames], places[:frames])
    write_stream(stream, folder / f"{name}.tsv")


def write_streams(folder: Path, scale: float) -> None:
    """The token streams of all sizes and seeds."""
    for size in SIZES:
        for seed in range(SEEDS):
            rng = np.random.default_rng([size, seed])
            out = folder / f"{size}-{seed}"
            for run in "123":
                for path in range(6):
                    frames = TEST // 6 if run == "3" else TRAIN // 12
                    write_sequence(out, f"path{path}_{run}", int(frames * scale), size, rng)
            write_vocabulary([f"w{unit:0{len(str(size**2 - 1))}d}" for unit in range(size**2)], out / "vocab.txt")


def gist_seconds() -> float:
    """CPU seconds of GIST of IMAGES images."""
    images = np.random.default_rng(0).integers(0, 256, (IMAGES, 128, 128)).astype(np.uint8)
    start = time.process_time()
    for image in images:
        gist(image)
    return time.process_time() - start


def main(scale: float) -> None:
    """Print both times and their ratio."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_streams(folder, scale)
        (folder / "grid.toml").write_text(CONFIG)
        gist_seconds()
        described = gist_seconds()
        start = time.process_time()
        rows = experiment(folder / "grid.toml", folder / "out").rows
        cells = time.process_time() - start
        described += gist_seconds()
    frames = int(TRAIN * scale) + int(TEST * scale)
    whole = described / (2 * IMAGES) * frames
    print(f"GIST   {1000 * described / (2 * IMAGES):8.2f} ms a frame, so {whole:.1f} s for {frames} frames")
    print(f"cells  {1000 * cells / len(rows):8.2f} ms a cell, {cells:.1f} s for {len(rows)} cells with their report")
    print(f"ratio  {cells / whole:8.2f} (at most 3 is wanted)")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)
