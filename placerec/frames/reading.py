"""How sources are to be read."""

from dataclasses import dataclass

from placerec.errors import SourceError

FORMATS = ("auto", "sequences", "places")


@dataclass(frozen=True)
class Reading:
    """How sources are to be read; the defaults fit most.

    `format`: what a folder of folders of images is: "sequences"; "places" (one folder per place: SOURCE/PLACE/ holds
    images); or "auto", which takes a folder of unlabelled, unstamped image folders for the latter and says so.
    Raises SourceError for a value that does not exist.
    """

    format: str = "auto"

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise SourceError(f"format {self.format!r} is not known; choose one of {', '.join(FORMATS)}")
