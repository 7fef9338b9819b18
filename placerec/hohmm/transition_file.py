"""Transitions as text: a header of places, then one row of probabilities per place.

Grammar (UTF-8, tabs; blank lines mean nothing)::

    file = place { TAB place } NL { row }
    row  = probability { TAB probability } NL

Row i: from the i-th place of the header to each place of the header. A row sums to 1; what rounding leaves off is
mended. The places are those of the model, in any order.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from placerec.arrays import Floats
from placerec.errors import ModelError, at
from placerec.files import read_text

# Numbers written with three digits may miss 1 by as much; more is a mistake.
_SUM_TOLERANCE = 1e-3


def read_transitions(path: Path | str, places: Sequence[str]) -> Floats:
    """The matrix float64 (C, C) of a file, rows and columns in the order of `places`, rows sum to 1.

    Raises ModelError with the line, the value and the remedy for what is not by the grammar.
    """
    path = Path(path)
    text = read_text(path, ModelError).removeprefix("\ufeff").replace("\r\n", "\n")
    lines = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    if not lines:
        raise ModelError(f"{path}: is empty; a header of places and one row per place are expected")
    (first, head), *rows = lines
    header = head.split("\t")
    if sorted(header) != sorted(places):
        expected, found = " ".join(places), " ".join(header)
        raise ModelError(at(path, first, f"the header is {found!r}; the model's places, {expected!r}, are expected"))
    if len(rows) != len(header):
        raise ModelError(f"{path}: {len(rows)} rows of probabilities for {len(header)} places; one per place is needed")
    matrix = np.array([_row(path, number, line, header) for number, line in rows])
    order = [header.index(place) for place in places]
    return matrix[np.ix_(order, order)]


def _row(path: Path, number: int, line: str, header: Sequence[str]) -> list[float]:
    cells = line.split("\t")
    if len(cells) != len(header):
        raise ModelError(at(path, number, f"{len(cells)} fields found, {len(header)} expected as in the header"))
    values = []
    for cell, place in zip(cells, header, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not 0 <= value <= 1:
            raise ModelError(at(path, number, f"{cell!r} under {place!r} is no probability from 0 to 1"))
        values.append(value)
    if abs(math.fsum(values) - 1) > _SUM_TOLERANCE:
        raise ModelError(at(path, number, f"the probabilities sum to {math.fsum(values):.6g}, not to 1"))
    return [value / math.fsum(values) for value in values]
