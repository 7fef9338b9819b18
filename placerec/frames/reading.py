"""How sources are to be read."""

from dataclasses import dataclass
from pathlib import Path

from placerec.errors import SourceError

FORMATS = ("auto", "sequences", "places")


@dataclass(frozen=True)
class Reading:
    """How sources are to be read; the defaults fit most.

    `format`: what a folder of folders of images is: "sequences"; "places" (one folder per place: SOURCE/PLACE/ holds
    images); or "auto", which takes a folder of unlabelled, unstamped image folders for the latter and says so.
    `every`: of so many frames the first is read. `topic`: the topic of a bag, None for its only one of images.
    `labels`: the labels file of a video or a bag, or a folder of NAME.labels; None for NAME.labels beside it.
    Raises SourceError for a value that does not exist.
    """

    format: str = "auto"
    every: int = 1
    topic: str | None = None
    labels: Path | None = None

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise SourceError(f"format {self.format!r} is not known; choose one of {', '.join(FORMATS)}")
        if self.every < 1:
            raise SourceError(f"every {self.every} frames is not possible; say 1 at least")
        if self.labels is not None and not self.labels.exists():
            raise SourceError(f"{self.labels}: no such file")
