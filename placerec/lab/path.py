"""Where the robot drives: a tour through the rooms, drawn as smooth curves and timed frame by frame.

COLD's robot (Saarbruecken, part B) drives into a room, makes a small circle to look around, and drives out the way it
came; in the kitchen it goes round the table. So do these tours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from placerec.lab.world import place

Track = NDArray[np.float64]

# Metres between the points of a dense track.
STEP = 0.01
# Metres that turning by a radian counts for: a robot slows down when it turns.
TURN = 0.6
# The robot's radius, and how much wider it keeps when it can.
CLEARANCE = 0.16


@dataclass(frozen=True)
class Timing:
    """How a tour is spread over frames.

    `frames` is the range of a sequence's length for seq3 and seq4; `still` the share of frames in which the robot
    stands; `pace` how unevenly it drives (deviation of the speed's logarithm); `wobble` the camera's unrest, radians;
    with `brief` the robot does not look around in the washroom, for which a short sequence has too few frames.
    """

    frames: dict[str, tuple[int, int]]
    still: float
    pace: float
    wobble: float
    brief: bool = False


# Mean frames of each visit of a tour (corridor between the rooms), after COLD's label files of Saarbruecken part B,
# and the coefficients of variation of the readings; the corridor's variation is mostly its visits' different length.
MEAN_FRAMES = {"TL-B": 290.0, "KT-B": 190.0, "1PO-B": 130.0, "PA-B": 92.0}
CORRIDOR_FRAMES = {"seq3": (45.0, 62.0, 122.0, 96.0), "seq4": (230.0, 72.0, 83.0, 112.0, 94.0)}
VARIATION = {"CR-B": 0.4, "TL-B": 0.3, "KT-B": 0.33, "1PO-B": 0.48, "PA-B": 0.5}


def _ring(x: float, y: float, radius: float, start: float, sweep: float) -> list[tuple[float, float]]:
    """Points on a circle about (x, y), from angle `start` over `sweep` degrees."""
    angles = np.radians(start + np.linspace(0, sweep, max(3, round(abs(sweep) / 40) + 1)))
    return [(x + radius * float(np.cos(a)), y + radius * float(np.sin(a))) for a in angles]


def _toilets(rng: np.random.Generator, brief: bool) -> list[tuple[float, float]]:
    first, second = rng.uniform(0.16, 0.26, 2)
    y1, y2 = 2.0 + rng.uniform(-0.15, 0.15), 4.3 + rng.uniform(-0.3, 0.25)
    way = [(1.7, 0.1), (1.98, 0.45), (2.05, 1.1), (2.06, 1.6)]
    look = _ring(2.06 - first, y1, first, 0, float(rng.uniform(300, 420)))
    if not brief:
        way += look
    way += [(2.07, y1 + 0.2), (2.08, 2.8), (2.08, 3.3), (2.1, y2 - 0.3)]
    turn = _ring(2.1 - second, y2, second, 0, float(rng.uniform(190, 330)))
    return way + turn + [(2.0, y2 - 0.5), (2.05, 3.3), (2.05, 2.8), (2.05, 1.9), (2.03, 1.1), (2.0, 0.5)]


def _kitchen(rng: np.random.Generator) -> list[tuple[float, float]]:
    wide = 1 + rng.uniform(-0.05, 0.03)
    loop = [(5.25, 1.75), (4.55, 2.1), (4.05, 2.7), (3.98, 3.6), (4.2, 4.4), (4.8, 4.78), (5.7, 4.78), (6.4, 4.55)]
    loop += [(6.72, 3.8), (6.7, 2.9), (6.4, 2.2), (5.85, 1.75)]
    around = [(5.35 + (x - 5.35) * wide, 3.3 + (y - 3.3) * wide) for x, y in loop]
    if rng.random() < 0.3:
        around = around[::-1]
    into = [(2.3, -0.3), (3.2, -0.35), (4.7, -0.35), (5.4, -0.05), (5.6, 0.6), (5.6, 1.2)]
    return into + around + [(5.6, 1.2), (5.55, 0.6), (5.3, -0.05), (4.6, -0.3), (2.5, -0.3), (1.4, -0.35)]


def _office(rng: np.random.Generator) -> list[tuple[float, float]]:
    radius, y = rng.uniform(0.16, 0.28), -4.15 + rng.uniform(-0.35, 0.35)
    turn = _ring(0.55 - radius, y, radius, 0, -float(rng.uniform(170, 300)))
    into = [(0.9, -0.6), (0.8, -1.1), (0.78, -1.7), (0.65, -2.6), (0.55, y + 0.5)]
    return into + turn + [(0.45, y + 0.7), (0.65, -2.5), (0.77, -1.7), (0.77, -1.1), (0.7, -0.55)]


def _printer(rng: np.random.Generator) -> list[tuple[float, float]]:
    radius, y = rng.uniform(0.14, 0.24), 1.95 + rng.uniform(-0.15, 0.3)
    turn = _ring(-6.25 + radius, y, radius, 180, -float(rng.uniform(170, 290)))
    lane = float(rng.uniform(-0.25, 0.05))
    way = [(0.2, lane), (-1.2, lane), (-3.2, lane), (-5.0, lane), (-5.9, 0.25), (-6.25, 0.8), (-6.25, 1.3)]
    return way + turn + [(-6.05, 1.2), (-5.9, 0.6), (-5.3, 0.15)]


def tour(path: str, rng: np.random.Generator, brief: bool = False) -> Track:
    """Control points (n, 2) of a tour of `path` (seq3 or seq4) with this run's liberties."""
    lane = float(rng.uniform(0.0, 0.35))
    points = [(0.1, 0.0), (0.5, 0.0), (1.1, 0.0), *_toilets(rng, brief)]
    points += _kitchen(rng) if path == "seq4" else [(1.9, -0.2), (1.5, -0.4)]
    points += [*_office(rng), *_printer(rng), (-4.0, lane), (-2.0, lane), (-0.6, lane), (0.3, lane)]
    return np.array(points)


def smooth(points: Track) -> Track:
    """The curve (n, 3) that the control points draw, a quadratic B-spline: x, y and heading, about STEP apart."""
    for _ in range(4):
        # Corner cutting: each round replaces every corner by two, a quarter of the way along its edges.
        inner = np.stack([0.75 * points[:-1] + 0.25 * points[1:], 0.25 * points[:-1] + 0.75 * points[1:]], axis=1)
        points = np.concatenate([points[:1], inner.reshape(-1, 2), points[-1:]])
    reach = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    even = np.linspace(0, reach[-1], round(reach[-1] / STEP) + 1)
    x, y = (np.interp(even, reach, points[:, i]) for i in (0, 1))
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    # A robot has inertia: headings are averaged over 15 cm.
    kernel = np.ones(15) / 15
    padded = np.pad(heading, 7, mode="edge")
    return np.stack([x, y, np.convolve(padded, kernel, mode="valid")], axis=1)


def clear(track: Track, outline: NDArray[np.float64], gap: float = CLEARANCE) -> bool:
    """Whether the whole track (n, 2+) keeps `gap` metres from all segments of `outline` (m, 4)."""
    start, edge = outline[:, :2], outline[:, 2:] - outline[:, :2]
    way = track[::6, None, :2] - start
    along = np.clip((way * edge).sum(-1) / np.maximum((edge * edge).sum(-1), 1e-12), 0, 1)
    return bool((np.hypot(*np.moveaxis(way - along[..., None] * edge, -1, 0)) >= gap).all())


def drive(path: str, outline: NDArray[np.float64], timing: Timing, rng: np.random.Generator) -> Track:
    """Poses (frames, 4) of one run of `path`: x, y in metres, heading and pitch in radians, free of collisions.

    Raises RuntimeError if no free tour is found: the floor plan is then wrong.
    """
    for _ in range(40):
        points = tour(path, rng, timing.brief)
        track = smooth(points + rng.normal(0, 0.035, points.shape))
        if clear(track, outline):
            break
    else:
        raise RuntimeError("the laboratory has no free way for the robot")
    poses = track[_schedule(path, track, timing, rng)]
    return _shaken(poses, timing, rng)


def _shaken(poses: Track, timing: Timing, rng: np.random.Generator) -> Track:
    """The poses with a heading that weaves about the way, and a pitch as a fourth column; standing, both are quiet."""
    shaken = np.column_stack([poses, np.zeros(len(poses))])
    drawn = rng.normal(0, timing.wobble, (len(poses), 2))
    off = 0.0
    for i in range(1, len(poses)):
        if np.array_equal(poses[i], poses[i - 1]):
            shaken[i, 3] = shaken[i - 1, 3]
        else:
            off = 0.7 * off + float(drawn[i, 0])
            shaken[i, 3] = 0.4 * float(drawn[i, 1])
        shaken[i, 2] += off
    return shaken


def _schedule(path: str, track: Track, timing: Timing, rng: np.random.Generator) -> NDArray[np.intp]:
    """The track's index of every frame: each visit gets its frames, and each frame its share of the way."""
    labels = np.array([place(x, y) for x, y in track[:, :2]])
    starts = np.concatenate([[0], np.flatnonzero(labels[1:] != labels[:-1]) + 1, [len(labels)]])
    effort = np.concatenate([[0.0], np.cumsum(np.hypot(STEP, TURN * np.diff(track[:, 2])))])
    visits = [str(labels[s]) for s in starts[:-1]]
    counts = _lengths(path, visits, np.diff(effort[np.minimum(starts, len(effort) - 1)]), timing, rng)
    indices = []
    for count, first, last in zip(counts, starts[:-1], starts[1:], strict=True):
        share = np.cumsum(_paces(int(count), timing, rng))
        goal = effort[first] + (share - share[0] / 2) / share[-1] * (effort[last - 1] - effort[first])
        indices.append(np.clip(np.searchsorted(effort, goal), first, last - 1))
    return np.concatenate(indices)


def _lengths(
    path: str, visits: Sequence[str], efforts: NDArray[np.float64], timing: Timing, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Frames of each visit: gamma as in COLD, then scaled to a total drawn from the timing's range."""
    corridor = iter(CORRIDOR_FRAMES[path])
    means = np.array([next(corridor) if v == "CR-B" else MEAN_FRAMES[v] for v in visits])
    spread = np.array([VARIATION[v] for v in visits])
    drawn = rng.gamma(spread**-2, means * spread**2)
    # Not much faster than the tour's mean speed, or a short visit would be a jump.
    drawn = np.maximum(drawn, 0.7 * efforts / efforts.sum() * means.sum())
    low, high = timing.frames[path]
    total = int(rng.integers(low, high + 1))
    return np.asarray(np.maximum(2, np.round(drawn / drawn.sum() * total)), np.int64)


def _paces(count: int, timing: Timing, rng: np.random.Generator) -> NDArray[np.float64]:
    """Relative way of each frame of a visit: a slowly changing speed, with stops of a few frames."""
    speed = np.exp(timing.pace * np.convolve(rng.normal(0, 1, count + 4), np.ones(5) / 5**0.5, mode="valid"))
    speed = np.minimum(speed, 2 * np.median(speed))
    # Stops last four frames on average; started this often, they fill the share that is asked for.
    chance, stop = timing.still / (4 * (1 - timing.still)), 0
    for i in range(1, count):
        if stop == 0 and rng.random() < chance:
            stop = int(rng.integers(2, 7))
        if stop:
            speed[i], stop = 0.0, stop - 1
    return np.asarray(speed, np.float64)
