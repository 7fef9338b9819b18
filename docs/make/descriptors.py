"""The table "GIST and CENTRIST" of docs/vision.md: single frames on a 20 x 20 map of live units.

python docs/make/descriptors.py DATA/SET... [--test GLOB ...]
"""

import sys
from pathlib import Path

import numpy as np
from single_frame import SEEDS, answers, arguments, described, fitted, folds, majority, spread

HEAD = """\
| set | test frames | majority class | GIST | CENTRIST |
| --- | --- | --- | --- | --- |
"""


def row(folder: Path, test: list[str]) -> str:
    """A set's line: means over five maps."""
    cells = []
    for kind in ("gist", "centrist"):
        frames = described(folder, kind)
        tests = folds(frames, test)
        right = [list[np.bool_]() for _ in SEEDS]
        for mask in tests:
            for seed, dictionary in enumerate(fitted(frames, mask)):
                right[seed].extend(answers(dictionary, frames, mask))
        cells.append(spread([float(np.mean(one)) for one in right]))
    share, asked = majority(frames, tests)
    return f"| {folder.name} | {asked} | {share:.3f} | {' | '.join(cells)} |\n"


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        sys.stdout.write(row(data, options.test))
        sys.stdout.flush()
