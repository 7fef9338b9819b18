"""`placerec label`: drives and their labels as a page asks for them and changes them."""

import logging
from collections.abc import Iterable, Sequence as Ordered
from dataclasses import asdict
from http import HTTPStatus
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.errors import SourceError
from placerec.frames import Sequence, SourceOptions, find_sequences
from placerec.frames.images import picture_at
from placerec.page.labels import ChangedError, DriveLabels, places_of, stretches_of
from placerec.page.propose import Proposer, look_first
from placerec.page.server import HERE, Answer, PageServer, RefusedError, Request, check_server, json_answer

log = logging.getLogger(__name__)

# Heights of pictures in pixels: in the film, and of the frame that is looked at.
HEIGHTS = {"small": 96, "large": 480}
_QUALITY = 80
_KEPT = 3600


def label_pages(
    sources: Iterable[Path | str],
    *,
    model: Path | str | None = None,
    network: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    host: str = HERE,
    port: int = 0,
) -> PageServer:
    """`placerec label`: the server of a page that labels the drives in `sources`; its `run` serves until Ctrl-C.

    `model`: a MODEL/ folder with words.npz that proposes labels; `network`: the file of the image network, for words of
    one. `host`, `port`: see `PageServer`. Raises SourceError for sources that cannot be read or labelled, ModelError
    for a model that cannot be loaded, MissingExtraError without the server, PageError if it cannot serve there.
    """
    check_server()
    sequences = find_sequences(sources, options=source_options)
    drives = [DriveLabels(sequence, source_options) for sequence in sequences]
    _check_apart(drives)
    proposer = Proposer(sequences, None if model is None else Path(model), network)
    desk = LabelDesk(drives, proposer)
    server = PageServer("label.html", desk.answer, host=host, port=port)
    if model is not None:
        proposer.start()
    return server


def _check_apart(drives: Ordered[DriveLabels]) -> None:
    """Raise SourceError if one file labels two drives: each would undo what the other says."""
    seen: dict[Path, Path] = {}
    for drive in drives:
        first = seen.setdefault(drive.file.path.resolve(), drive.sequence.source)
        if first != drive.sequence.source:
            raise SourceError(f"{drive.file.path}: labels {first} and {drive.sequence.source}; label one at a time")


class LabelDesk:
    """Answers what the page asks of drives and their labels."""

    def __init__(self, drives: Ordered[DriveLabels], proposer: Proposer) -> None:
        self.drives, self.proposer = drives, proposer

    def answer(self, request: Request) -> Answer | None:
        """The answer to a request, None for one that makes no sense."""
        match request.method, request.parts:
            case "GET", ("state",):
                return json_answer(self._state())
            case "GET", ("versions",):
                return json_answer({"versions": [drive.version() for drive in self.drives], **self._proposing()})
            case "GET", ("labels", _):
                return self._labels(request.number(1, len(self.drives)))
            case "GET", ("times", _):
                times = [frame.time for frame in self._sequence(request).frames]
                return Answer(np.array(times, "<f8").tobytes(), "application/octet-stream", keep=_KEPT)
            case "GET", ("frame", _, _):
                return json_answer({"name": self._sequence(request).frames[self._frame(request)].name})
            case "GET", ("picture", _, _, ("small" | "large") as size):
                return picture_answer(self._sequence(request), self._frame(request), HEIGHTS[size])
            case "GET", ("proposal", _):
                return self._proposal(request.number(1, len(self.drives)))
            case "GET", ("doubt", _):
                return self._doubt(request.number(1, len(self.drives)))
            case "POST", ("labels", _):
                return self._save(request.number(1, len(self.drives)), request.sent)
            case "POST", ("learn",):
                started = self.proposer.start(lambda: [drive.state()[1] for drive in self.drives])
                return json_answer({"started": started})
        return None

    def _sequence(self, request: Request) -> Sequence:
        return self.drives[request.number(1, len(self.drives))].sequence

    def _frame(self, request: Request) -> int:
        return request.number(2, len(self._sequence(request).frames))

    def _state(self) -> dict[str, object]:
        drives = []
        for drive in self.drives:
            version, places = drive.state()
            frames = drive.sequence.frames
            drives.append(
                {
                    "name": drive.sequence.name,
                    "file": str(drive.file.path),
                    "count": len(frames),
                    "timed": not np.isnan(frames[0].time),
                    "version": version,
                    "stretches": stretches_of(places),
                }
            )
        return {"drives": drives, "places": self.proposer.places, **self._proposing()}

    def _proposing(self) -> dict[str, object]:
        return {name: getattr(self.proposer, name) for name in ("busy", "said", "round")}

    def _labels(self, number: int) -> Answer:
        version, places = self.drives[number].state()
        return json_answer({"version": version, "stretches": stretches_of(places)})

    def _save(self, number: int, sent: object) -> Answer:
        drive = self.drives[number]
        if not isinstance(sent, dict) or not isinstance(sent.get("version"), str):
            raise RefusedError(HTTPStatus.BAD_REQUEST, "labels are {version, stretches}")
        places = places_of(sent.get("stretches"), len(drive.sequence.frames))
        try:
            version = drive.save(places, sent["version"])
        except ChangedError as error:
            version, places = drive.state()
            return json_answer(
                {"error": str(error), "version": version, "stretches": stretches_of(places)}, HTTPStatus.CONFLICT
            )
        return json_answer({"version": version})

    def _proposal(self, number: int) -> Answer:
        """The path, and where to look first by the labels as they are saved."""
        if self.proposer.proposals is None:
            return json_answer(None)
        proposal = self.proposer.proposals[number]
        looks = look_first(proposal, self.drives[number].state()[1])
        return json_answer({"stretches": stretches_of(proposal.places), "looks": [asdict(look) for look in looks]})

    def _doubt(self, number: int) -> Answer | None:
        if self.proposer.proposals is None:
            return None
        return Answer(self.proposer.proposals[number].doubt.astype("<f4").tobytes(), "application/octet-stream")


def picture_answer(sequence: Sequence, frame: int, height: int) -> Answer:
    """A frame as JPEG, at most so many pixels high; RefusedError with the reason if it cannot be read."""
    found = picture_at(sequence, frame, height)
    if isinstance(found, str):
        raise RefusedError(HTTPStatus.NOT_FOUND, found)
    return Answer(jpeg(found), "image/jpeg", keep=_KEPT)


def jpeg(pixels: NDArray[Any]) -> bytes:
    """Pixels uint8 (h, w) or (h, w, 3) as a JPEG."""
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
