"""Live decoding: a belief for each frame as it comes, the newest one first; frames are dropped rather than late."""

import logging
import math
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from placerec.errors import ModelError, StreamError, VisionError
from placerec.frames import Frame, Sequence, SourceOptions, find_sequences
from placerec.frames.camera import Camera
from placerec.frames.images import all_images
from placerec.frames.live import LatestFrameQueue, LiveFrame, Stopped, ended_by_interrupt, real_time
from placerec.hohmm import Belief, SequenceDecoder, format_header
from placerec.hohmm.decoder import Distances, Words
from placerec.methods.decode import format_belief
from placerec.methods.decoders import HOHMM, make_decoder
from placerec.model import load_model
from placerec.model.decoding import AS_LEARNED, Decoding, ScorerName
from placerec.words.folder import is_stream

if TYPE_CHECKING:
    from placerec.vision import Dictionary, DictionarySet

log = logging.getLogger(__name__)

EVERY = 5.0  # seconds between two notes of the same kind
_STEP = math.log(1.01)
_ANY = np.arange(64, dtype=np.uint8).reshape(8, 8)


@dataclass(frozen=True)
class LiveReport:
    """What became of the frames: `seen` came, `answered` got a line, `dropped` came while another was worked on,
    `unusable` held no image. `seconds`: from the first arrival to the last line.

    Latency in seconds from a frame's arrival to the moment that its line was taken; nan without any. `median` and
    `late`, the 95th percentile, are right to 1 %.
    """

    seen: int
    answered: int
    dropped: int
    unusable: int
    seconds: float
    median: float
    late: float
    longest: float

    def __str__(self) -> str:
        rate = f" ({self.answered / self.seconds:.1f} a second)" if self.seconds > 0 else ""
        text = f"frames seen {self.seen}, answered {self.answered}{rate}, dropped {self.dropped}"
        if self.unusable:
            text += f", unusable {self.unusable}"
        if self.answered:
            times = (f"{1000 * value:.1f}" for value in (self.median, self.late, self.longest))
            text += "; ms from arrival to answer: median {}, 95th percentile {}, longest {}".format(*times)
        return text


def decode_live(
    source: Path | str,
    model: Path | str,
    *,
    words: Path | str | None = None,
    network: Path | str | None = None,
    method: str = HOHMM,
    source_options: SourceOptions = SourceOptions(),
    options: Decoding = AS_LEARNED,
    scorer: ScorerName = "native",
    as_json: bool = False,
) -> Generator[str, None, None]:
    """`placerec decode --live`: the lines of a beliefs file, each as soon as its frame has come; TSV with a header.

    `source`: a camera, or a sequence whose frames have times, which is played at its own pace. See `follow_live`.
    `words`: the words.npz, by default that in `model`; `network`: the file of the image network, for words of one.
    `method`: one of `METHODS`. Raises ModelError for options that look ahead or write files, and StreamError unless
    `source` is one sequence of images.
    """
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
    header = None if as_json else format_header(decoder.places, unknown=decoder.asks_unknown)
    with closing(follow_live(sequence, dictionary, decoder)) as answers:
        for frame, belief in answers:
            if header is not None:
                yield header
                header = None
            yield format_belief(frame.name, frame.time, frame.place, belief, as_json=as_json)


def open_live(
    source: Path | str,
    model: Path | str,
    *,
    words: Path | str | None,
    network: Path | str | None,
    method: str,
    source_options: SourceOptions,
    options: Decoding,
    scorer: ScorerName,
) -> "tuple[Sequence, DictionarySet, SequenceDecoder]":
    """What is followed live, what turns its images into words, and words into beliefs; arguments: see `decode_live`."""
    from placerec.vision import DictionarySet

    if options.looks_ahead or options.explain:
        raise ModelError("live decoding answers before later words are known: no smooth, viterbi, lag or explain")
    if is_stream(Path(source)):
        raise StreamError(f"{source}: is a token stream, and live decoding is of images; name a camera or a video")
    models = load_model(model)
    dictionary = DictionarySet.load(words or models.folder.words, network=network)
    decoder = make_decoder(method, models, options=options, scorer=scorer, dictionary=dictionary)
    sequences = find_sequences([source], options=source_options, endless=True)
    if len(sequences) > 1:
        raise StreamError(f"{source}: holds {len(sequences)} sequences; name one of them to be played live")
    return sequences[0], dictionary, decoder


class Answering(Protocol):
    """What answers frames: a `SequenceDecoder`, or what stands before one."""

    def answer(self, words: Words, time: float | None = None, distance: Distances = None) -> Belief:
        """The belief after one more frame with these words."""

    def skip(self, time: float | None = None) -> Belief:
        """The belief after one more frame that has no word."""


def follow_live(
    sequence: Sequence,
    dictionary: "Dictionary | DictionarySet",
    decoder: Answering,
    *,
    see: Callable[[LiveFrame], None] | None = None,
    tell: Callable[[LiveReport], None] | None = None,
) -> Generator[tuple[Frame, Belief], None, None]:
    """Each frame and the belief after it, until the sequence ends or, in the main thread, Ctrl-C is pressed.

    Frames that come while another is worked on are dropped but for the newest. They count as frames without a word
    for transitions per frame. So do frames without a usable image, which give no belief. Both are logged, and so is
    the report at the end, which `tell` gets, too. Whoever iterates is part of the latency: a frame is answered when
    the next one is asked for. Raises SourceError for a source that gives nothing, StreamError for times that are
    needed and missing or go back. `see` gets each frame that is worked on, before, in colours.
    """
    tally = _Tally(sequence)
    # Filters are made when they are first needed: not while the first frames wait.
    colours = dictionary.spec.colours
    dictionary.words_of(np.dstack([_ANY] * 3) if colours else _ANY)
    # Whoever shows frames wants colours, too.
    frames = partial(_live_frames, sequence, colours or see is not None)
    with closing(LatestFrameQueue(frames)) as queue, ended_by_interrupt(queue):
        try:
            for live in queue:
                if see is not None:
                    see(live)
                for _ in range(tally.missed(live)):
                    decoder.skip()
                belief = _believed(live, dictionary, decoder, tally)
                if belief is not None:
                    yield live.frame, belief
                    tally.answered(time.monotonic(), live)
        finally:
            queue.stop()
            report = tally.report(queue)
            if report.seen:
                log.info("%s: %s", tally.name, report)
            if tell is not None:
                tell(report)


def _live_frames(sequence: Sequence, colours: bool, stopped: Stopped) -> Iterator[LiveFrame]:
    if isinstance(sequence.recording, Camera):
        return sequence.recording.live_frames(stopped, colours=colours)
    return real_time(all_images(sequence, colours=colours), stopped)


def _believed(
    live: LiveFrame, dictionary: "Dictionary | DictionarySet", decoder: Answering, tally: "_Tally"
) -> Belief | None:
    frame, image = live.frame, live.image
    try:
        if isinstance(image, str):
            raise VisionError(image)
        words, distances = dictionary.words_of(image)
    except VisionError as error:
        tally.unusable(error)
        decoder.skip()
        return None
    try:
        return decoder.answer(words, frame.time, distances)
    except ModelError as error:
        raise StreamError(f"{tally.name}: frame {frame.name!r}: {error}") from error


class _Tally:
    """Counts what becomes of the frames, in constant memory, and says now and then what is lost."""

    def __init__(self, sequence: Sequence) -> None:
        self.name = str(sequence.recording) if isinstance(sequence.recording, Camera) else str(sequence.source)
        self._next = self._dropped = self._unusable = 0
        self._first = self._last = math.nan
        self._longest = math.nan
        # Latencies, to the nearest power of 1.01.
        self._latencies: Counter[int] = Counter()
        self._said: dict[str, float] = {}

    def missed(self, live: LiveFrame) -> int:
        """How many frames were dropped between this one and the one before."""
        missed = live.number - self._next
        self._next = live.number + 1
        self._dropped += missed
        if math.isnan(self._first):
            self._first = live.came
        if missed:
            message = "%s: %d of %d frames dropped so far: they come faster than they are worked on"
            self._say(message, self.name, self._dropped, self._next)
        return missed

    def unusable(self, error: VisionError) -> None:
        """Take note of a frame that is no image."""
        self._unusable += 1
        self._say("%s; no belief for this frame, %d such so far", error, self._unusable)

    def answered(self, now: float, live: LiveFrame) -> None:
        """Take note that the answer to a frame was taken."""
        latency = max(now - live.came, 1e-9)
        self._last = now
        self._longest = latency if math.isnan(self._longest) else max(latency, self._longest)
        self._latencies[round(math.log(latency) / _STEP)] += 1

    def report(self, queue: LatestFrameQueue) -> LiveReport:
        """What is known by now."""
        answered = self._latencies.total()
        return LiveReport(
            queue.seen,
            answered,
            queue.dropped,
            self._unusable,
            0.0 if math.isnan(self._last) else self._last - self._first,
            self._quantile(0.5),
            self._quantile(0.95),
            self._longest,
        )

    def _quantile(self, share: float) -> float:
        left = share * self._latencies.total()
        for power in sorted(self._latencies):
            left -= self._latencies[power]
            if left <= 0:
                return min(math.exp(power * _STEP), self._longest)
        return math.nan

    def _say(self, message: str, *args: object) -> None:
        now = time.monotonic()
        if now - self._said.get(message, -math.inf) >= EVERY:
            self._said[message] = now
            log.warning(message, *args)
