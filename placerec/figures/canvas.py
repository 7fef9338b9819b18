"""The sheet that a picture is drawn on: the file, places in inches on it, and the colours of places.

matplotlib is optional and is imported inside the functions; no pyplot, so no global figure and no window.
"""

import logging
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from placerec.arrays import Floats
from placerec.errors import OutputError, check_optional
from placerec.files import whole_file
from placerec.hohmm.beliefs import UNKNOWN_PLACE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Layout = Literal["constrained", "compressed"]
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
WHITE, BLACK, _GREY = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.78, 0.78, 0.78)

# The laboratory has them, too. Behind a code: which of several rooms, and which part of the building.
_COLD_CODE = re.compile(r"([12]PO|[A-Z]+)\d*-[AB]")
_COLD_PLACES = {
    "CR": "corridor",
    "PA": "printer area",
    "TL": "toilet",
    "ST": "stairs",
    "KT": "kitchen",
    "LO": "large office",
    "1PO": "one-person office",
    "2PO": "two-person office",
    "TR": "terminal room",
    "RL": "robot lab",
}

# The width of a letter of DejaVu Sans, in units of the font's size, on the safe side.
LETTER = 0.66

# Inches that are left free at the edges of a sheet.
MARGIN = 0.3


@contextmanager
def figure_file(path: Path | str, width: float, height: float, layout: _Layout | None = None) -> "Iterator[Figure]":
    """An empty figure of this size in inches, written to `path` (PNG, SVG or PDF by suffix) when the block ends.

    `layout`: None where the places of all axes are given. What is drawn in the block depends on nothing of the user's
    matplotlib settings. Raises OutputError for another suffix or a path that cannot be written, MissingExtraError
    without matplotlib.
    """
    path = Path(path)
    check_figure(path)
    with _silent_matplotlib():
        import matplotlib
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["svg.hashsalt"] = "placerec"
        # A place may be called `a$b$`.
        matplotlib.rcParams["text.parse_math"] = False
        figure = Figure(figsize=(width, height), layout=layout)
        FigureCanvasAgg(figure)
        yield figure
        with whole_file(path) as partial, _logged_warnings():
            figure.savefig(partial, dpi=_DPI, metadata=_METADATA[path.suffix.lower()])


@contextmanager
def picture_file(out: Path | str | None) -> Iterator[Path | None]:
    """Where to draw the picture of a command, or None where none is wanted; it is at `out` when the block ends.

    Raises, before the block, OutputError for a suffix of no picture and for a path that cannot be written, and
    MissingExtraError without matplotlib.
    """
    if out is None:
        yield None
        return
    check_figure(out)
    with whole_file(Path(out)) as partial:
        yield partial


def check_figure(path: Path | str) -> None:
    """Raise OutputError for a suffix of no picture, MissingExtraError without matplotlib: before any work."""
    if Path(path).suffix.lower() not in _METADATA:
        raise OutputError(f"{path}: no kind of picture; let its name end in .png, .svg or .pdf")
    check_optional("matplotlib", "a picture")


def place_colours(places: Sequence[str]) -> Floats:
    """A colour for each of n places, (n, 3) red, green, blue from 0 to 1; from the thirteenth on they get darker.

    `unknown` is light grey.
    """
    base = np.array([[(colour >> shift & 255) / 255 for shift in (16, 8, 0)] for colour in _PALETTE])
    index = np.arange(len(places))
    colours: Floats = base[index % len(base)] * 0.6 ** (index // len(base))[:, None]
    colours[[place == UNKNOWN_PLACE for place in places]] = _GREY
    return colours


def place_title(place: str) -> str:
    """A place's name as a picture's legend has it: what COLD's codes mean stands behind them (`CR-B corridor`)."""
    code = _COLD_CODE.fullmatch(place)
    meaning = _COLD_PLACES.get(code[1]) if code else None
    return f"{place} {meaning}" if meaning else place


def letter_colour(ground: Floats) -> str:
    """Black or white, whichever is read better on a colour (3,) of red, green, blue."""
    return "black" if ground @ (0.299, 0.587, 0.114) > 0.45 else "white"


def panel(figure: "Figure", left: float, top: float, wide: float, high: float) -> "Axes":
    """New axes of this size in inches, so many inches from the left and from the top of a figure."""
    width, height = figure.get_size_inches()
    return figure.add_axes((left / width, 1 - (top + high) / height, wide / width, high / height))


def inches(axes: "Axes") -> float:
    """How wide axes are."""
    return float(axes.bbox.width / axes.figure.dpi)


def write_line(figure: "Figure", top: float, text: str, size: float, colour: str = "black") -> None:
    """A line of text at the left margin, its foot so many inches from the top of a figure; `size` in points."""
    width, height = figure.get_size_inches()
    figure.text(MARGIN / width, 1 - top / height, text, fontsize=size, color=colour)


@contextmanager
def _silent_matplotlib() -> Iterator[None]:
    """matplotlib complains of a home that it may not write to, where it would keep a list of fonts; it does without."""
    complaints = logging.getLogger("matplotlib")
    level = complaints.level
    complaints.setLevel(logging.ERROR)
    try:
        yield
    finally:
        complaints.setLevel(level)


@contextmanager
def _logged_warnings() -> Iterator[None]:
    """matplotlib warns where its font lacks a letter of a place's name: told once each, and through the log."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for message in dict.fromkeys(str(warning.message) for warning in caught):
        _LOG.warning("picture: %s", message)
