"""How stable the words are, as text and as a picture."""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import numpy as np

from placerec.evaluation.summary import percent
from placerec.figures.canvas import figure_file, picture_file
from placerec.frames import SourceOptions, find_sequences
from placerec.jobs import Progress
from placerec.vision import Dictionary
from placerec.vision.stability import Stability, word_changes

# Okabe and Ito's vermilion and sky blue.
_FAR, _NEAR = "#D55E00", "#56B4E9"
_NEXT = "the next frame, for comparison"


def stability(
    sources: Iterable[Path | str],
    words: Path | str,
    out: Path | str | None = None,
    *,
    source_options: SourceOptions = SourceOptions(),
    seed: int = 0,
    progress: Progress | None = None,
) -> Stability:
    """`placerec stability`: how many frames of the sources get another word by what a camera does to pictures.

    `out`: the picture to draw, PNG, SVG or PDF by suffix. `seed`: of the noise. Raises SourceError and VisionError for
    what cannot be read, OutputError for a picture that cannot be written, MissingExtraError without matplotlib.
    """
    with picture_file(out) as picture:
        dictionary = Dictionary.load(words)
        found = word_changes(find_sequences(sources, options=source_options), dictionary, seed=seed, progress=progress)
        if picture is not None:
            plot_stability(found, picture)
    return found


def format_stability(found: Stability) -> str:
    """A line per change: the share of frames whose word changes, and of these the share that stays next to it."""
    lines = [f"Of {found.frames} frames", f"{'':<32}{'other word':>11}{'a neighbour':>13}{'farther':>9}"]
    for kind, amount, changed, neighbour, frames in _rows(found):
        shares = [percent(count / frames) for count in (changed, neighbour, changed - neighbour)]
        lines.append(f"{f'{kind} {amount}'.strip():<32}{shares[0]:>11}{shares[1]:>13}{shares[2]:>9}")
    return "\n".join(lines)


def plot_stability(found: Stability, path: Path | str) -> None:
    """Draw the shares as bars, PNG, SVG or PDF by suffix.

    Raises OutputError for another suffix or a path that cannot be written, MissingExtraError without matplotlib.
    """
    rows = _rows(found)
    groups = [list(group) for _, group in groupby(rows, key=lambda row: row[0])]
    # Half a row of space between the kinds of change.
    tops = np.concatenate([np.arange(len(group)) for group in groups])
    tops = tops + np.repeat(np.cumsum([0, *(len(group) + 0.5 for group in groups[:-1])]), [len(g) for g in groups])
    near = np.array([100 * neighbour / frames for _, _, _, neighbour, frames in rows])
    far = np.array([100 * (changed - neighbour) / frames for _, _, changed, neighbour, frames in rows])
    height = 1.6 + 0.26 * float(tops[-1] + 1)
    with figure_file(path, 9.0, height) as figure:
        axes = figure.add_axes((0.27, 0.6 / height, 0.68, 1 - 1.45 / height))
        axes.barh(tops, far, color=_FAR, height=0.8, label="to a word farther away on the map")
        axes.barh(tops, near, left=far, color=_NEAR, height=0.8, label="to one of the 8 neighbours of its unit")
        for top, share in zip(tops, near + far, strict=True):
            axes.text(share + 0.6, top, f"{share:.1f}", va="center", fontsize=8)
        names = [f"{kind} {amount}".strip() for kind, amount, *_ in rows]
        axes.set_yticks(tops, labels=names, fontsize=8.5)
        axes.tick_params(axis="y", length=0)
        axes.tick_params(axis="x", labelsize=8)
        axes.set(ylim=(tops[-1] + 0.7, -0.7), xlim=(0, max(10.0, 1.12 * float((near + far).max()))))
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.set_xlabel("frames whose word changes, %", fontsize=8.5)
        figure.text(0.02, 1 - 0.4 / height, f"How stable the words of {found.frames} frames are", fontsize=14)
        figure.legend(loc="upper left", bbox_to_anchor=(0.01, 1 - 0.5 / height), ncols=2, frameon=False, fontsize=8.5)


def _rows(found: Stability) -> list[tuple[str, str, int, int, int]]:
    """Kind, amount, words that change, those that change to a neighbour, of how many frames."""
    rows = [(r.kind, r.amount, r.changed, r.neighbour, found.frames) for r in found.results]
    if found.steps:
        rows.append((_NEXT, "", found.step_changed, found.step_neighbour, found.steps))
    return rows
