"""The commands that look at words: sources in, tables and pictures out."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from placerec.figures.panels import check_figure
from placerec.files import whole_file
from placerec.frames import Reading, Sequence, find_sequences
from placerec.inspection.frame import FrameView, view_frame
from placerec.inspection.frame_sheet import draw_frame_sheet
from placerec.inspection.word_sheet import draw_word_sheet
from placerec.inspection.word_stability import plot_stability
from placerec.inspection.words import WordTable, typical_images, word_table
from placerec.jobs import Progress
from placerec.vision import Dictionary, describe
from placerec.vision.stability import Stability, word_changes


def show_words(
    words: Path | str,
    sources: Iterable[Path | str],
    out: Path | str | None = None,
    *,
    matrix: Path | str | None = None,
    reading: Reading = Reading(),
    progress: Progress | None = None,
) -> WordTable:
    """`placerec show-words`: what the words of a words.npz look like among the frames of the sources.

    `out`: the picture to draw, PNG, SVG or PDF by suffix. `matrix`: the frames' descriptors, for a dictionary of
    descriptors that were computed elsewhere (`describe`). Raises what `find_sequences`, `describe` and
    `draw_word_sheet` raise.
    """
    with _picture(out) as picture:
        dictionary = Dictionary.load(words)
        table, sequences = _looked_up(sources, dictionary, reading, progress, matrix)
        if picture is not None:
            images = typical_images(table, sequences)
            draw_word_sheet(table, images, picture, title=f"The words of {Path(words).name}")
    return table


def show_frame(
    image: Path | str,
    words: Path | str,
    sources: Iterable[Path | str] = (),
    out: Path | str | None = None,
    *,
    reading: Reading = Reading(),
    progress: Progress | None = None,
) -> FrameView:
    """`placerec show-frame`: what a words.npz sees in an image, and which units are nearest to it.

    `sources`: sequences whose frames tell what the units look like and which places they belong to. `out`: the
    picture to draw. Raises as `show_words` does, and SourceError or VisionError for an image that cannot be used.
    """
    with _picture(out) as picture:
        dictionary = Dictionary.load(words)
        view = view_frame(image, dictionary)
        sequences: list[Sequence] = []
        if sources := list(sources):
            table, sequences = _looked_up(sources, dictionary, reading, progress)
            view = replace(view, table=table)
        if picture is not None:
            typical = {} if view.table is None else typical_images(view.table, sequences, view.nearest)
            draw_frame_sheet(view, typical, picture)
    return view


def stability(
    sources: Iterable[Path | str],
    words: Path | str,
    out: Path | str | None = None,
    *,
    reading: Reading = Reading(),
    seed: int = 0,
    progress: Progress | None = None,
) -> Stability:
    """`placerec stability`: how many frames of the sources get another word by what a camera does to pictures.

    `out`: the picture to draw. `seed`: of the noise. Raises as `show_words` does.
    """
    with _picture(out) as picture:
        dictionary = Dictionary.load(words)
        found = word_changes(find_sequences(sources, reading=reading), dictionary, seed=seed, progress=progress)
        if picture is not None:
            plot_stability(found, picture)
    return found


def _looked_up(
    sources: Iterable[Path | str],
    dictionary: Dictionary,
    reading: Reading,
    progress: Progress | None,
    matrix: Path | str | None = None,
) -> tuple[WordTable, list[Sequence]]:
    """The table of the sources' frames, and the sequences that these are of."""
    sequences = find_sequences(sources, reading=reading)
    return word_table(describe(sequences, dictionary.spec, matrix=matrix, progress=progress), dictionary), sequences


@contextmanager
def _picture(out: Path | str | None) -> Iterator[Path | None]:
    """Where to draw, if anything is to be drawn; that it cannot be written is found out before the work."""
    if out is None:
        yield None
        return
    check_figure(out)
    with whole_file(Path(out)) as partial:
        yield partial
