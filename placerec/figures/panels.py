"""The parts that pictures of beliefs are put together from: strips, legend, confusion matrix, and the file.

matplotlib is optional and is imported inside the functions; no pyplot, so no global figure and no window.
"""

import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from placerec.errors import OutputError, check_optional
from placerec.evaluation.metrics import Evaluation, codes, place_order, right_frames
from placerec.evaluation.summary import percent, shorten
from placerec.files import whole_file
from placerec.hohmm.beliefs import UNKNOWN, Beliefs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOG = logging.getLogger(__name__)

# Dates and versions would make two pictures of the same numbers differ.
_METADATA: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
_DPI = 130

# Okabe & Ito (2008) and Tol's muted scheme, mixed so that the first few are furthest apart in lightness and hue for any
# colour vision. Black is kept for what is wrong.
_BRIGHT = (0x56B4E9, 0xE69F00, 0x009E73, 0xCC79A7, 0x332288, 0xF0E442)
_PALETTE = (*_BRIGHT, 0xD55E00, 0x0072B2, 0x999933, 0x882255, 0xDDCC77, 0x999999)
_WHITE, _BLACK, _GREY = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.78, 0.78, 0.78)

# More columns than this would fall between the pixels of a strip.
_MOST_COLUMNS = 1500
_BELIEF_ROWS = 120

# Where the bars of a strip lie, in units of the belief's height.
_TRUE, _DECIDED, _WRONG = (1.07, 1.43), (-0.33, -0.07), (-0.55, -0.41)

# The width of a letter of DejaVu Sans, in units of the font's size, on the safe side.
_LETTER = 0.66


@contextmanager
def figure_file(path: Path | str, width: float, height: float) -> "Iterator[Figure]":
    """An empty figure of this size in inches, written to `path` (PNG, SVG or PDF by suffix) when the block ends.

    What is drawn in the block depends on nothing of the user's matplotlib settings. Raises OutputError for another
    suffix or a path that cannot be written, MissingExtraError without matplotlib.
    """
    path = Path(path)
    check_figure(path)
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["svg.hashsalt"] = "placerec"
        # A place may be called `a$b$`.
        matplotlib.rcParams["text.parse_math"] = False
        figure = Figure(figsize=(width, height))
        FigureCanvasAgg(figure)
        yield figure
        with whole_file(path) as partial, _logged_warnings():
            figure.savefig(partial, dpi=_DPI, metadata=_METADATA[path.suffix.lower()])


def check_figure(path: Path | str) -> None:
    """Raise what `figure_file` would, of suffix and matplotlib: before an hour of work, and not after it."""
    if Path(path).suffix.lower() not in _METADATA:
        raise OutputError(f"{path}: no kind of picture; let its name end in .png, .svg or .pdf")
    check_optional("matplotlib", "a picture")


def place_colours(places: Sequence[str]) -> NDArray[np.float64]:
    """A colour for each of n places, (n, 3) red, green, blue from 0 to 1; from the thirteenth on they get darker.

    `unknown` is light grey.
    """
    base = np.array([[(colour >> shift & 255) / 255 for shift in (16, 8, 0)] for colour in _PALETTE])
    index = np.arange(len(places))
    colours: NDArray[np.float64] = base[index % len(base)] * 0.6 ** (index // len(base))[:, None]
    colours[[place == UNKNOWN for place in places]] = _GREY
    return colours


def letter_colour(ground: NDArray[np.float64]) -> str:
    """Black or white, whichever is read better on a colour (3,) of red, green, blue."""
    return "black" if ground @ (0.299, 0.587, 0.114) > 0.45 else "white"


def belief_strip(axes: "Axes", beliefs: Beliefs, *, places: Sequence[str] | None = None, title: str = "") -> None:
    """Draw one sequence: true places on top, the beliefs stacked to 1, decided places below, black where wrong.

    With a column `unknown` its share comes on top of the places', which are drawn as much lower.

    places: all places of the picture, in the order of their colours; by default the sequence's own. Of a long
    sequence evenly spaced frames are drawn.
    """
    places = place_order([beliefs]) if places is None else places
    frames = len(beliefs.frames)
    # One more colour than places: the last answers for index -1, no label.
    colours = np.vstack([place_colours(places), _WHITE])
    axes.set(xlim=(0, max(frames, 1)), ylim=(_WRONG[0] - 0.05, _TRUE[1]), facecolor="none")
    axes.spines[:].set_visible(False)
    heights = [sum(span) / 2 for span in (_TRUE, (0, 1), _DECIDED, _WRONG)]
    axes.set_yticks(heights, labels=["true", "belief", "decided", "wrong"], fontsize=6.5)
    axes.tick_params(axis="x", labelsize=6.5, length=2, pad=1.5)
    axes.tick_params(axis="y", length=0, pad=2)
    axes.set_title(title, loc="left", fontsize=8.5, pad=3)
    if not frames:
        axes.text(0.5, 0.5, "no frames", ha="center", va="center", fontsize=8, color="0.4")
        return
    truth, decided = codes(beliefs.truth, places), codes(beliefs.best, places)
    drawn = np.unique(np.linspace(0, frames - 1, min(frames, _MOST_COLUMNS)).round().astype(np.int64))
    if len(drawn) < frames:
        axes.set_title(f"{len(drawn)} of {frames} frames are drawn", loc="right", fontsize=6.5, color="0.4", pad=3)
    wrong = (~right_frames(beliefs) & (truth >= 0))[drawn]
    bars = [
        (_TRUE, colours[truth[drawn]][None]),
        ((0.0, 1.0), colours[_stacked(*_shares(beliefs, drawn, places))]),
        (_DECIDED, colours[decided[drawn]][None]),
        (_WRONG, np.where(wrong[:, None], _BLACK, _WHITE)[None]),
    ]
    for (low, high), image in bars:
        axes.imshow(image, extent=(0, frames, low, high), aspect="auto", interpolation="nearest", origin="lower")
    axes.set(xlim=(0, frames), ylim=(_WRONG[0] - 0.05, _TRUE[1]))
    _name_visits(axes, truth, places)


def confusion_panel(axes: "Axes", evaluation: Evaluation) -> None:
    """Draw the confusion matrix: frames as numbers, each row coloured by its shares."""
    counts = evaluation.confusion
    size = len(counts)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, interpolation="nearest")
    names = [shorten(place, 18) for place in evaluation.places]
    cell = _inches(axes) * 72 / size
    axes.set_xticks(range(size), labels=names, rotation=90, fontsize=min(8, cell))
    axes.set_yticks(range(size), labels=names, fontsize=min(8, cell))
    axes.tick_params(length=0, pad=3)
    axes.set_xlabel("decided place", fontsize=8)
    axes.set_ylabel("true place", fontsize=8, labelpad=6)
    axes.set_title("Confusion matrix: frames, darker for more of the row", loc="left", fontsize=8.5)
    axes.spines[:].set_color("0.7")
    font = min(9.0, cell / (_LETTER * (1 + len(str(counts.max())))))
    # Numbers that nobody can read only hide the colours.
    for row, column in np.argwhere(counts) if font >= 3.5 else []:
        colour = "white" if shares[row, column] > 0.55 else "black"
        text = str(counts[row, column])
        axes.text(column, row, text, ha="center", va="center", fontsize=font, color=colour)


def legend_panel(axes: "Axes", places: Sequence[str]) -> None:
    """Draw which colour is which place, and what black and white mean."""
    from matplotlib.patches import Patch

    colours = [*map(tuple, place_colours(places).tolist()), _BLACK, _WHITE]
    labels = [*(shorten(place, 22) for place in places), "decided wrongly", "no label"]
    patches = [
        Patch(facecolor=colour, edgecolor="0.5", linewidth=0.5, label=label)
        for colour, label in zip(colours, labels, strict=True)
    ]
    axes.axis("off")
    axes.legend(handles=patches, loc="upper left", ncols=2, frameon=False, fontsize=8, borderaxespad=0)


def strip_title(name: str, accuracy: float | None) -> str:
    """The line above a strip: which sequence, and how much of it was right."""
    return f"{shorten(name, 70)}   {'no frame has a label' if accuracy is None else percent(accuracy) + ' right'}"


def _shares(
    beliefs: Beliefs, drawn: NDArray[np.int64], places: Sequence[str]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The probabilities of the frames `drawn` (n, columns), and the place of each column."""
    belief = beliefs.belief[drawn]
    if beliefs.unknown is None:
        return belief, codes(beliefs.places, places)
    unknown = beliefs.unknown[drawn, None]
    return np.hstack([belief * (1 - unknown), unknown]), codes((*beliefs.places, UNKNOWN), places)


def _stacked(belief: NDArray[np.float64], place: NDArray[np.int64]) -> NDArray[np.int64]:
    """The place at every height of the stacked beliefs: (rows from 0 to 1, frames)."""
    heights = (np.arange(_BELIEF_ROWS) + 0.5) / _BELIEF_ROWS
    below = (np.cumsum(belief, axis=1)[None] <= heights[:, None, None]).sum(axis=2)
    # Rounding may leave the sum a hair under 1.
    stacked: NDArray[np.int64] = place[np.minimum(below, len(place) - 1)]
    return stacked


def _name_visits(axes: "Axes", truth: NDArray[np.int64], places: Sequence[str]) -> None:
    """Write a place's name into its bar where there is room: colours alone are hard to look up."""
    font = 6.5
    room = _inches(axes) * 72 / len(truth)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(truth)) + 1))
    colours = place_colours(places)
    for start, end in zip(starts, [*starts[1:], len(truth)], strict=True):
        place = int(truth[start])
        if place >= 0 and (end - start) * room > _LETTER * font * (len(places[place]) + 1):
            colour = letter_colour(colours[place])
            spot = ((start + end) / 2, sum(_TRUE) / 2 - 0.02)
            axes.text(*spot, places[place], ha="center", va="center", fontsize=font, color=colour)


def _inches(axes: "Axes") -> float:
    return float(axes.bbox.width / axes.figure.dpi)


@contextmanager
def _logged_warnings() -> Iterator[None]:
    """matplotlib warns where its font lacks a letter of a place's name: told once each, and through the log."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for message in dict.fromkeys(str(warning.message) for warning in caught):
        _LOG.warning("picture: %s", message)
