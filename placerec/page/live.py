"""`placerec decode --live --page`: what a camera sees, what is believed, and places that are named on the spot."""

import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence as Ordered
from contextlib import closing
from http import HTTPStatus
from pathlib import Path
from typing import Any

import numpy as np

from placerec.errors import PlacerecError
from placerec.frames import Frame, SourceOptions
from placerec.frames.images import shrunk
from placerec.frames.live import LiveFrame
from placerec.frames.places import check_place, check_twins
from placerec.frames.sequence import shown_pixels
from placerec.hohmm import Belief, SequenceDecoder, format_header
from placerec.hohmm.decoder import Distances, Words
from placerec.methods.decode import format_belief
from placerec.methods.decoders import HOHMM, make_decoder
from placerec.methods.live import follow_live, open_live
from placerec.model import load_model, update
from placerec.model.decoding import AS_LEARNED, Decoding, ScorerName
from placerec.page.keeping import KeptFrames
from placerec.page.label import HEIGHTS, jpeg
from placerec.page.labels import MAX_NAME
from placerec.page.server import HERE, Answer, PageServer, RefusedError, Request, check_server, json_answer

log = logging.getLogger(__name__)

# Seconds of the past that the page shows, and frames at most.
PAST, MOST = 60.0, 6000


def decode_live_page(
    source: Path | str,
    model: Path | str,
    *,
    show: Callable[[PageServer], None],
    keep: Path | str | None = None,
    host: str = HERE,
    port: int = 0,
    words: Path | str | None = None,
    network: Path | str | None = None,
    method: str = HOHMM,
    source_options: SourceOptions = SourceOptions(),
    options: Decoding = AS_LEARNED,
    scorer: ScorerName = "native",
    as_json: bool = False,
) -> Generator[str, None, None]:
    """`placerec decode --live --page`: what `placerec.methods.decode_live` gives, and a page that shows it meanwhile.

    `show` gets the server before the first frame. `keep`: the folder that frames are kept in while a place is named on
    the page (`KeptFrames`); None: none can be named. The place stands in the lines, too. When the page teaches the
    model new places, a header line with these comes before the lines that follow. Other arguments, and what is raised:
    see `decode_live` and `PageServer`.
    """
    check_server()
    sequence, dictionary, decoder = open_live(
        source,
        model,
        words=words,
        network=network,
        method=method,
        source_options=source_options,
        options=options,
        scorer=scorer,
    )

    def make() -> SequenceDecoder:
        return make_decoder(method, load_model(model), options=options, scorer=scorer, dictionary=dictionary)

    desk = LiveDesk(sequence.name, decoder, Path(model), make, None if keep is None else Path(keep), dictionary.names)
    server = PageServer("live.html", desk.answer_page, host=host, port=port)
    show(server)
    server.start()
    places: tuple[str, ...] = ()
    try:
        with closing(follow_live(sequence, dictionary, desk, see=desk.see)) as answers:
            for frame, belief in answers:
                place = desk.took(frame, belief)
                if belief.places != places and not as_json:
                    yield format_header(belief.places, unknown=decoder.asks_unknown)
                places = belief.places
                yield format_belief(frame.name, frame.time, place, belief, as_json=as_json)
    finally:
        server.close()


class LiveDesk:
    """Stands between the frames and their decoder: remembers what the page shows, and keeps what is named.

    `make`: a decoder of the model as it is on the disk by now.
    """

    def __init__(
        self,
        name: str,
        decoder: SequenceDecoder,
        model: Path,
        make: Callable[[], SequenceDecoder],
        keep: Path | None,
        dictionaries: Ordered[str] = ("",),
    ) -> None:
        self.name, self.decoder, self.model, self.keep = name, decoder, model, keep
        self.place, self.said, self.busy = "", "", False
        self._make, self._dictionaries = make, dictionaries
        self._lock = threading.Lock()
        self._live: LiveFrame | None = None
        self._given: tuple[Ordered[str], Ordered[float | None]] = ((), ())
        self._past: deque[dict[str, Any]] = deque(maxlen=MOST)
        self._answered = self._seen = self._taken = 0
        self._kept: KeptFrames | None = None
        self._named: list[str] = []

    # ---- as the decoder of what comes

    def see(self, live: LiveFrame) -> None:
        """Take note of a frame before it is worked on."""
        with self._lock:
            self._live = live
            self._seen, self._taken = live.number + 1, self._taken + 1

    def answer(self, words: Words, time: float | None = None, distance: Distances = None) -> Belief:
        """The decoder's answer."""
        given = [words] if isinstance(words, str) else [*words]
        far = [*distance] if isinstance(distance, Ordered | np.ndarray) else [distance]
        with self._lock:
            self._given = given, far
            return self.decoder.answer(words, time, distance)

    def skip(self, time: float | None = None) -> Belief:
        """The decoder's answer to a frame without a word."""
        with self._lock:
            return self.decoder.skip(time)

    def took(self, frame: Frame, belief: Belief) -> str:
        """Remember the belief after a frame, keep the frame if its place is named, and return that place."""
        with self._lock:
            named, live, given = self.place, self._live, self._given
            place = named or frame.place
            self._answered += 1
            row = {"k": self._answered, "t": frame.time, "b": belief.probability.tolist(), "u": belief.unknown}
            self._past.append(row | {"l": place, "w": belief.word, "p": belief.places})
            while self._past[0]["t"] < frame.time - PAST:
                self._past.popleft()
            kept = self._kept
        shown = shown_pixels(live.image) if live is not None else ""
        if kept is not None and not isinstance(shown, str):
            try:
                kept.add(frame, shown, *given, named)
            except PlacerecError as error:
                self.said, self.place = f"nothing more is kept: {error}", ""
                log.warning("%s", error)
        return place

    # ---- as the page asks

    def answer_page(self, request: Request) -> Answer | None:
        """The answer to a request of the page, None for one that makes no sense."""
        match request.method, request.parts:
            case "GET", ("now", _):
                return json_answer(self._now(request.number(1, 10**9)))
            case "GET", ("picture", _):
                return self._picture()
            case "POST", ("name",):
                return self._name(request.sent)
            case "POST", ("teach",):
                return self._teach()
        return None

    def _now(self, since: int) -> dict[str, object]:
        """What the page does not know yet: it knows the answers up to number `since`."""
        with self._lock:
            places = self.decoder.places
            rows = [
                {name: value for name, value in row.items() if name != "p"} | {"t": _or_none(row["t"])}
                for row in self._past
                if row["k"] > since and row["p"] == places
            ]
            return {
                "name": self.name,
                "places": [*places],
                "known": sorted({*places, *self._named}),
                "rows": rows,
                "seen": self._seen,
                "dropped": self._seen - self._taken,
                "frame": self._live.number if self._live else -1,
                "place": self.place,
                "keeps": self.keep is not None,
                "kept": self._kept.count if self._kept else 0,
                "folder": str(self._kept.folder) if self._kept else "",
                "said": self.said,
                "busy": self.busy,
            }

    def _picture(self) -> Answer:
        """The newest frame; a number in the address makes it another one to the browser."""
        live = self._live
        if live is None:
            raise RefusedError(HTTPStatus.NOT_FOUND, "no frame has come yet")
        shown = shown_pixels(live.image)
        if isinstance(shown, str):
            raise RefusedError(HTTPStatus.NOT_FOUND, shown)
        return Answer(jpeg(shrunk(shown, HEIGHTS["large"])), "image/jpeg")

    def _name(self, sent: Any) -> Answer:
        place = sent.get("place") if isinstance(sent, dict) else None
        if not isinstance(place, str) or len(place) > MAX_NAME:
            raise RefusedError(HTTPStatus.BAD_REQUEST, "a name is {place}")
        if self.keep is None:
            return _told("name no place: decode was started without --keep FOLDER/, and nothing would stay of it")
        if place and (reason := check_place(place)):
            return _told(f"the place {place!r} {reason}; name it otherwise")
        with self._lock:
            names = [*self.decoder.places, *self._named, place] if place else []
        check_twins((name, "the page") for name in names)
        with self._lock:
            if place and self._kept is None:
                taken = load_model(self.model).description.trained_on
                self._kept = KeptFrames(self.keep, self.name, self._dictionaries, taken)
            if place and place not in self._named:
                self._named.append(place)
            self.place, self.said = place, ""
        return json_answer({"place": place})

    def _teach(self) -> Answer:
        with self._lock:
            kept = self._kept
            if self.busy or kept is None or not kept.count:
                return _told("there is nothing to teach: name the place where the camera is, and wait some frames")
            self.busy, self.place, self._kept = True, "", None
        threading.Thread(target=self._taught, args=(kept,), daemon=True, name="teach").start()
        return json_answer({"taught": kept.name})

    def _taught(self, kept: KeptFrames) -> None:
        """Add what was kept to the model on the disk, and decode by that from now on."""
        try:
            update(self.model, [kept.tokens])
            decoder = self._make()
            with self._lock:
                self.decoder = decoder
            self.said = f"{self.model} has learned {kept.count} frames of {kept.name}"
        except PlacerecError as error:
            self.said = f"nothing is learned: {error}"
        except Exception as error:  # A thread that dies would tell nobody.
            log.error("teaching failed: %r", error)
            self.said = "nothing is learned: it failed, and the reason is where placerec was started"
        finally:
            self.busy = False


def _told(error: str) -> Answer:
    return json_answer({"error": error}, HTTPStatus.BAD_REQUEST)


def _or_none(time: float) -> float | None:
    return None if math.isnan(time) else time
