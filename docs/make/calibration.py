"""The table "How sure is it" of docs/recognizer.md: beliefs as they are, and after each remedy, on held-out sequences.

python docs/make/calibration.py DATA/SET... [--test GLOB ...]

The test sequences are halved by turns: what is fitted on one half is judged on the other, and the reverse. Means over
maps of 10 x 10 and 20 x 20, three each; order 2. `power`: word probabilities raised to a power inside the filter.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from held_out import filtered, part, trained
from single_frame import arguments, described, fold_names
from sklearn.isotonic import IsotonicRegression

from placerec.arrays import Floats, Ints
from placerec.evaluation.confidence import reliability
from placerec.evaluation.metrics import change_latencies
from placerec.hohmm import fit_calibration

HEAD = """\
| set | beliefs | accuracy | latency | log loss | ECE |
| --- | --- | --- | --- | --- | --- |
"""
POWERS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.12, 0.08)
Half = list[tuple[Floats, Ints]]  # per sequence: log10 p (T, C), the true columns (T,), -1 where there is none
Fit = Callable[[Half], Callable[[Floats], Floats]]


def log_loss(belief: Floats, truth: Ints) -> float:
    """Nats per frame."""
    return float(-np.log(np.maximum(belief[np.arange(len(truth)), truth], 1e-15)).mean())


def together(half: Half, decode: Callable[[Floats], Floats]) -> tuple[Floats, Ints]:
    """The beliefs of all labelled frames, and their places."""
    belief = np.concatenate([decode(log10_p) for log10_p, _ in half])
    truth = np.concatenate([truth for _, truth in half])
    return belief[truth >= 0], truth[truth >= 0]


def plain(log10_p: Floats) -> Floats:
    """The paper's beliefs."""
    return filtered(log10_p)[1]


def temperature(half: Half) -> Callable[[Floats], Floats]:
    """What `placerec calibrate` does."""
    found = fit_calibration(*together(half, plain))
    return lambda log10_p: found.apply(plain(log10_p))


def power(half: Half) -> Callable[[Floats], Floats]:
    """The best of some powers of the word probabilities."""
    best = min(POWERS, key=lambda p: log_loss(*together(half, lambda log10_p: plain(p * log10_p))))
    return lambda log10_p: plain(best * log10_p)


def isotonic(half: Half) -> Callable[[Floats], Floats]:
    """The best place's belief by isotonic regression, the rest shared as before."""
    belief, truth = together(half, plain)
    low, high = 1 / belief.shape[1], 1 - 1 / (len(truth) + 2)
    curve = IsotonicRegression(y_min=low, y_max=high, out_of_bounds="clip")
    curve.fit(belief.max(axis=1), belief.argmax(axis=1) == truth)

    def decode(log10_p: Floats) -> Floats:
        belief = plain(log10_p)
        rows, best = np.arange(len(belief)), belief.argmax(axis=1)
        top = curve.predict(belief[rows, best])
        changed: Floats = belief * ((1 - top) / np.maximum(1 - belief[rows, best], 1e-12))[:, None]
        changed[rows, best] = top
        return changed

    return decode


REMEDIES: dict[str, Fit] = {
    "as they are": lambda half: plain,
    "temperature": temperature,
    "power": power,
    "isotonic": isotonic,
}


def judged(half: Half, decode: Callable[[Floats], Floats]) -> list[float]:
    """Accuracy, median latency, log loss and calibration error."""
    latencies = [change_latencies(truth, decode(log10_p).argmax(axis=1) == truth) for log10_p, truth in half]
    belief, truth = together(half, decode)
    right = belief.argmax(axis=1) == truth
    latency = float(np.median(np.concatenate(latencies)))
    return [float(right.mean()), latency, log_loss(belief, truth), reliability(belief.max(axis=1), right).error]


def rows(folder: Path, test: list[str]) -> str:
    """A set's lines."""
    frames = described(folder)
    maps: dict[int, Half] = {}
    for names in fold_names(frames, test):
        others = [name for name in dict.fromkeys(frames.sequences) if name not in names]
        for number, case in enumerate(trained(part(frames, others), part(frames, names))):
            column = {place: i for i, place in enumerate(case.places)}
            truths = [np.array([column.get(place, -1) for place in stream.places]) for stream in case.tests]
            maps.setdefault(number, []).extend(zip(case.log10_p, truths, strict=True))
    lines = []
    for name, fit in REMEDIES.items():
        halves = [(one[k::2], one[1 - k :: 2]) for one in maps.values() for k in (0, 1)]
        accuracy, latency, loss, error = np.mean([judged(other, fit(half)) for half, other in halves], axis=0)
        lines.append(f"| {folder.name} | {name} | {accuracy:.3f} | {latency:.1f} | {loss:.3f} | {error:.3f} |\n")
    return "".join(lines)


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        sys.stdout.write(rows(data, options.test))
        sys.stdout.flush()
