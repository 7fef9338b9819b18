"""Beliefs as a notebook shows them: a row for each place, the darker the surer, and below where it is true."""

from html import escape
from itertools import groupby

import numpy as np

from placerec.arrays import Floats, Mask
from placerec.hohmm.beliefs import UNKNOWN_PLACE, Beliefs

# More columns than this would fall between the pixels, more rows leave the screen.
_COLUMNS, _ROWS = 200, 20
_BELIEF, _TRUE = "0,114,178", "110,110,110"


def beliefs_html(beliefs: Beliefs) -> str:
    """The beliefs as HTML that needs nothing else."""
    truth, best = np.array(beliefs.truth, np.str_), np.array(beliefs.best, np.str_)
    labelled = truth != ""
    right = (
        f"; {100 * (truth == best)[labelled].mean():.1f} % of {labelled.sum()} labelled ones right"
        if labelled.any()
        else ""
    )
    head = f"<b>{escape(beliefs.name)}</b>: {len(beliefs)} frames{right}"
    share = np.ones(len(beliefs)) if beliefs.unknown is None else 1 - beliefs.unknown
    columns = dict(zip(beliefs.places, (beliefs.belief * share[:, None]).T, strict=True))
    if beliefs.unknown is not None:
        columns[UNKNOWN_PLACE] = beliefs.unknown
    surest = sorted(columns, key=lambda place: -float(columns[place].sum()))[:_ROWS]
    shown = [place for place in columns if place in surest] if len(beliefs) else []
    rows = "".join(_row(place, columns[place], truth == place) for place in shown)
    more = f"<p>and {len(columns) - len(shown)} more places</p>" if 0 < len(shown) < len(columns) else ""
    return f'<div><p>{head}</p><table style="border-spacing:0">{rows}</table>{more}</div>'


def _row(place: str, belief: Floats, true: Mask) -> str:
    strips = _strip(belief, _BELIEF, 12) + _strip(true.astype(np.float64), _TRUE, 3)
    return f'<tr><td style="text-align:right">{escape(place)}</td><td style="width:40em">{strips}</td></tr>'


def _strip(shares: Floats, colour: str, height: int) -> str:
    """Shares of 1 (n,), n > 0, from left to right: the mean of the frames that a column stands for."""
    starts = np.unique(np.linspace(0, len(shares), min(len(shares), _COLUMNS) + 1).astype(np.int64))
    means = np.add.reduceat(shares, starts[:-1]) / np.diff(starts)
    ends = 100 * starts / len(shares)
    stops = []
    for level, run in groupby(range(len(means)), key=lambda k: round(float(means[k]), 2)):
        first, *rest = run
        last = rest[-1] if rest else first
        stops.append(f"rgba({colour},{level:g}) {ends[first]:.4g}% {ends[last + 1]:.4g}%")
    return f'<div style="height:{height}px;background:linear-gradient(to right,{",".join(stops)})"></div>'
