"""The table "Two views" of docs/vision.md: single frames on maps of both views and two sizes.

python docs/make/views.py DATA/SET... [--test GLOB ...]
"""

import sys
from pathlib import Path

import numpy as np
from single_frame import SEEDS, answers, arguments, described, folds, majority, spread

from placerec.vision import DictionarySet, DictionarySetOptions

HEAD = """\
| set | test frames | majority class | plain, 10 x 10 | plain, 20 x 20 | pn, 10 x 10 | pn, 20 x 20 |
| --- | --- | --- | --- | --- | --- | --- |
"""


def row(folder: Path, test: list[str]) -> str:
    """A set's line: means over the maps of five seeds."""
    frames = described(folder)
    tests = folds(frames, test)
    right: dict[str, list[list[np.bool_]]] = {}
    for mask in tests:
        places = frames.table.places.take(~mask)
        for seed in SEEDS:
            options = DictionarySetOptions(seed=seed)
            made = DictionarySet.fit(frames.values[~mask], spec=frames.spec, places=places, options=options)
            for dictionary in made.dictionaries:
                maps = right.setdefault(dictionary.name, [[] for _ in SEEDS])
                maps[seed].extend(answers(dictionary, frames, mask))
    share, asked = majority(frames, tests)
    cells = [spread([float(np.mean(one)) for one in maps]) for maps in right.values()]
    return f"| {folder.name} | {asked} | {share:.3f} | {' | '.join(cells)} |\n"


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        sys.stdout.write(row(data, options.test))
        sys.stdout.flush()
