"""How soon our map is as good as MiniSom's after ten epochs, on vectors that neither was trained on.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/som.py [TRAINING-VECTORS]

The vectors are synthetic: a camera drifts about 300 spots whose 80 coordinates have the falling variances of GIST's
principal components; the held-out ones are another such walk. MiniSom learns one vector at a time, in random order,
from the plane of its PCA, ten times through (500,000 steps for 50,000 vectors), once with its own schedule (width S/2
to 1) and once with that of our maps (S/2 to 0.5). Ours is trained with more and more epochs until the quantisation
error is no larger, and by default. Both are judged by the same functions. The seconds are wall time in one process.
"""

import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from minisom import MiniSom
from numpy.typing import NDArray

from placerec.vision.som import Rule, map_quality, train_som

SIDE, COMPONENTS, SPOTS = 20, 80, 300
EPOCHS = (2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 50)
Rows = NDArray[np.float32]


def walk(n: int, spots: NDArray[np.float64], rng: np.random.Generator) -> Rows:
    """n steps: on average 50 frames from one spot to the next along a straight line, and a slow drift about it."""
    stops = np.cumsum(rng.integers(20, 80, n // 20 + 2))
    visited = spots[rng.integers(len(spots), size=len(stops))]
    place = np.searchsorted(stops, np.arange(n), side="right")
    start = np.concatenate([[0], stops])[place]
    share = ((np.arange(n) - start) / (stops[place] - start))[:, None]
    way = visited[place - 1] * (1 - share) + visited[place] * share
    drift, noise = np.zeros((n, spots.shape[1])), rng.normal(size=(n, spots.shape[1]))
    for step in range(1, n):
        drift[step] = 0.95 * drift[step - 1] + noise[step]
    deviation: NDArray[np.float64] = spots.std(axis=0)
    return np.asarray(way + 0.1 * deviation * drift, np.float32)


def minisom(rows: Rows, last: float) -> Rows:
    """Ten epochs of MiniSom; its width falls linearly to 1, or exponentially to `last` if that is less."""
    som = MiniSom(
        SIDE,
        SIDE,
        rows.shape[1],
        sigma=SIDE / 2,
        learning_rate=0.5,
        decay_function="linear_decay_to_zero",
        sigma_decay_function="linear_decay_to_one",
        random_seed=0,
    )
    if last < 1:
        # It has no public way to a width below 1.
        som._sigma_decay_function = lambda width, step, steps: width * (last / width) ** (step / steps)
    som.pca_weights_init(rows)
    som.train(rows, 10 * len(rows), random_order=True)
    return np.asarray(som.get_weights(), np.float32).reshape(SIDE * SIDE, -1)


def ours(rows: Rows, epochs: int | None, last: float, rule: Rule = "batch") -> Rows:
    """Our codebook."""
    return train_som(rows, SIDE, rng=np.random.default_rng(0), rule=rule, width=last, epochs=epochs).codebook


def timed(name: str, train: Callable[[], Rows], held_out: Rows) -> tuple[float, float]:
    """(seconds, quantisation error), printed with the topographic error."""
    start = time.perf_counter()
    codebook = train()
    seconds = time.perf_counter() - start
    quality = map_quality(held_out, codebook, np.ones(len(codebook), np.int64))
    error = quality.quantisation_error
    print(f"{name:44} {seconds:8.2f} s   QE {error:.4f}   TE {quality.topographic_error:.3f}", flush=True)
    return seconds, error


def main(n: int) -> None:
    """Print times, errors and ratios."""
    rng = np.random.default_rng(0)
    spots = rng.normal(size=(SPOTS, COMPONENTS)) * (1 + np.arange(COMPONENTS)) ** -0.8
    rows, held_out = walk(n, spots, rng), walk(max(n // 5, 100), spots, rng)
    ours(rows[:2000], 2, 1)  # imports and pools are not what is measured
    for last in (1.0, 0.5):
        slow, wanted = timed(f"MiniSom, 10 epochs, width to {last}", partial(minisom, rows, last), held_out)
        for width in sorted({last, 0.5}, reverse=True):
            for epochs in EPOCHS:
                name = f"placerec, {epochs} epochs, width to {width}"
                fast, error = timed(name, partial(ours, rows, epochs, width), held_out)
                if error <= wanted:
                    print(f"MiniSom / placerec: {slow / fast:.0f}")
                    break
    timed("placerec, default", partial(ours, rows, None, 0.5), held_out)
    timed("placerec, on-line rule, 10 epochs", partial(ours, rows, 10, 0.5, "online"), held_out)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50_000)
