"""The table "Live units" of docs/vision.md: single frames on a 20 x 20 map, answered by live units or by all.

python docs/make/live_units.py DATA/SET... [--test GLOB ...]
"""

import sys
from pathlib import Path

import numpy as np
from single_frame import SEEDS, SIZE, answering, answers, arguments, described, fitted, folds, majority, spread

from placerec.vision.options import Units

HEAD = """\
| set | test frames | majority class | all units | live units | gain | dead units | test frames on them |
| --- | --- | --- | --- | --- | --- | --- | --- |
"""


def row(folder: Path, test: list[str]) -> str:
    """A set's line: means over five maps, and how many test frames are nearest to a dead unit."""
    frames = described(folder)
    tests = folds(frames, test)
    of: tuple[Units, ...] = ("all", "live")
    right = {units: [list[np.bool_]() for _ in SEEDS] for units in of}
    dead, on_dead = [], 0
    for mask in tests:
        for seed, dictionary in enumerate(fitted(frames, mask)):
            for units, maps in right.items():
                maps[seed].extend(answers(answering(dictionary, units), frames, mask))
            dead.append(dictionary.dead)
            nearest, _ = answering(dictionary, "all").words(frames.values[mask])
            on_dead += int((dictionary.hits[nearest] == 0).sum())
    share, asked = majority(frames, tests)
    every, live = ([float(np.mean(one)) for one in right[units]] for units in of)
    on_dead_share = on_dead / len(SEEDS) / sum(int(mask.sum()) for mask in tests)
    return (
        f"| {folder.name} | {asked} | {share:.3f} | {spread(every)} | {spread(live)} "
        f"| {np.mean(live) - np.mean(every):+.3f} | {np.mean(dead):.0f} of {SIZE**2} | {100 * on_dead_share:.1f} % |\n"
    )


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        sys.stdout.write(row(data, options.test))
        sys.stdout.flush()
