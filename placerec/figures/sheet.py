"""A contact sheet: labelled pictures in rows and columns."""

from collections.abc import Mapping
from pathlib import Path

from placerec.figures.panels import figure_file
from placerec.frames import read_gray


def contact_sheet(images: Mapping[str, Mapping[str, Path]], path: Path) -> None:
    """Draw the images, row title -> column title -> image file, as one picture.

    Raises MissingExtraError without matplotlib, SourceError for an image that cannot be read.
    """
    columns = sorted({column for row in images.values() for column in row})
    with figure_file(path, width=2.1 * len(columns) + 0.3, height=1.6 * len(images) + 0.3) as figure:
        figure.set_layout_engine("compressed")
        grid = figure.subplots(len(images), len(columns), squeeze=False)
        for (row, pictures), axes_row in zip(images.items(), grid, strict=True):
            for column, axes in zip(columns, axes_row, strict=True):
                axes.set_xticks([])
                axes.set_yticks([])
                if column in pictures:
                    axes.imshow(read_gray(pictures[column]), cmap="gray", vmin=0, vmax=255)
            axes_row[0].set_ylabel(row)
        for column, axes in zip(columns, grid[0], strict=True):
            axes.set_title(column)
