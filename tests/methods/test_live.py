"""Live decoding against the same frames decoded as files: the same beliefs, and nothing lost without a word."""

import json
import logging
import math
import re
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import with_columns, write_images

from placerec.errors import ModelError, SourceError, StreamError
from placerec.frames import Frame, Sequence as FrameSequence, find_sequences, read_gray
from placerec.frames.sequence import Gray
from placerec.hohmm import Belief, Recognizer, format_beliefs
from placerec.methods import LiveReport, decode, decode_live, follow_live, load_decoder
from placerec.model import Decoding, train_lm
from placerec.model.decoding import PAPER
from placerec.vision import Dictionary, DictionaryOptions
from placerec.vision.sources import train_dictionary
from placerec.words import read_stream
from placerec.words.tokenize import tokenize

Images = Sequence[tuple[Frame, Gray] | tuple[Frame, Gray | str]]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs, words of both, and a model of the first."""
    root = tmp_path_factory.mktemp("live")
    for seed, name in enumerate(("seq1", "seq2")):
        write_images(root / "runs" / name, seed)
    train_dictionary([root / "runs"], root / "words.npz", options=DictionaryOptions(size=3))
    tokenize([root / "runs"], root / "words.npz", root / "tokens")
    train_lm([root / "tokens/seq1.tsv"], root / "model", as_in_paper=True)
    return root


@dataclass
class Recorded:
    """A recording that waits until each frame is answered (`turns`), or tells when all are out (`over`)."""

    given: Images
    turns: threading.Semaphore | None = None
    over: threading.Event = field(default_factory=threading.Event)
    endless = False

    def frames(self, first: int = 0, *, colours: bool = False) -> Iterator[tuple[Frame, Gray | str]]:
        for shot in self.given[first:]:
            if self.turns is not None:
                assert self.turns.acquire(timeout=60)
            yield shot
        self.over.set()

    def picture(self, index: int) -> Gray | str:
        return self.given[index][1]

    def files(self) -> list[Path]:
        return []


def recorded(images: Images, turns: threading.Semaphore | None = None) -> tuple[FrameSequence, Recorded]:
    recording = Recorded(images, turns)
    return FrameSequence("run", [frame for frame, _ in images], Path("run"), recording), recording


def images_of(folder: Path, seconds: float = 0.0) -> list[tuple[Frame, Gray]]:
    """The images of a sequence, `seconds` apart."""
    (sequence,) = find_sequences([folder])
    return [(replace(frame, time=i * seconds), read_gray(frame.path)) for i, frame in enumerate(sequence.frames)]


def followed(
    images: Images, world: Path, options: Decoding = PAPER, method: str = "hohmm"
) -> tuple[list[tuple[Frame, Belief]], LiveReport]:
    """What comes of frames each of which waits until the one before is decoded."""
    turns, reports = threading.Semaphore(1), list[LiveReport]()
    sequence, _ = recorded(images, turns)
    decoder = load_decoder(method, world / "model", options=options)

    def in_turn(work: Callable[..., Belief]) -> Callable[..., Belief]:
        def working(*args: Any) -> Belief:
            try:
                return work(*args)
            finally:
                turns.release()

        return working

    for name in ("answer", "skip"):
        setattr(decoder, name, in_turn(getattr(decoder, name)))
    answers = list(follow_live(sequence, Dictionary.load(world / "words.npz"), decoder, tell=reports.append))
    (report,) = reports
    return answers, report


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("hohmm", Decoding()),
        ("hohmm", Decoding(transition="learned", unknown=True)),
        ("hohmm", Decoding(per="second", max_gap=2.0)),
        ("majority", Decoding()),
        ("mtd", Decoding()),
        ("wu2009", Decoding(unknown=True)),
    ],
)
def test_the_same_as_from_files(method: str, options: Decoding, world: Path) -> None:
    stream = read_stream(world / "tokens/seq2.tsv")
    stream = with_columns(stream, times=np.arange(len(stream)) * 0.004)
    expected = load_decoder(method, world / "model", options=options).decode(stream)
    started = time.monotonic()
    answers, report = followed(images_of(world / "runs/seq2", 0.004), world, options, method)
    assert 0 < report.seconds <= time.monotonic() - started
    assert [frame.name for frame, _ in answers] == list(expected.frames)
    assert [frame.place for frame, _ in answers] == list(expected.truth)
    assert [belief.word for _, belief in answers] == list(expected.words)
    assert [belief.best for _, belief in answers] == list(expected.best)
    np.testing.assert_allclose([belief.probability for _, belief in answers], expected.belief, atol=1e-12)
    if expected.unknown is not None:
        # A token stream has six digits of the distances.
        assert [belief.unknown for _, belief in answers] == pytest.approx(expected.unknown.tolist(), rel=1e-4)
    assert (report.seen, report.answered, report.dropped, report.unusable) == (12, 12, 0, 0)
    assert 0 < report.median <= report.late <= report.longest < math.inf


def test_the_lines_are_those_of_a_file(world: Path) -> None:
    """A folder of images is played, too, by the times in their names, which are a second apart here."""
    short, model, words = write_images(world / "short", seed=1, frames=2), world / "model", world / "words.npz"
    (beliefs,) = decode([short], model, words=words)
    lines = list(decode_live(short, model, words=words))
    objects = [json.loads(line) for line in decode_live(short, model, words=words, as_json=True)]
    # On a machine that stands still for a second a frame is dropped.
    assert len(objects) <= 2
    if len(lines) == 3:
        assert lines == format_beliefs(beliefs).splitlines()
    first = json.loads(format_beliefs(beliefs, as_json=True).splitlines()[0])
    assert objects[0].pop("belief") == pytest.approx(first.pop("belief"))
    assert objects[0] == first


def test_whoever_is_slow_gets_the_newest_and_is_told(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    images = [
        (replace(frame, name=str(i)), image) for i, (frame, image) in enumerate(5 * images_of(world / "runs/seq2"))
    ]
    sequence, recording = recorded(images)
    decoder, reports = load_decoder("hohmm", world / "model"), list[LiveReport]()
    assert isinstance(decoder, Recognizer)
    names = []
    with caplog.at_level(logging.INFO):
        for frame, _ in follow_live(sequence, Dictionary.load(world / "words.npz"), decoder, tell=reports.append):
            names.append(int(frame.name))
            assert recording.over.wait(60)
    assert len(names) <= 3
    assert names == sorted(names)
    assert names[-1] == 59
    (report,) = reports
    assert (report.seen, report.answered, report.dropped) == (60, len(names), 60 - len(names))
    # Each frame counts for transitions per frame, those that were dropped, too.
    assert decoder._now.frame == 60
    assert f"{60 - len(names)} of 60 frames dropped so far" in caplog.text
    summary = rf"frames seen 60, answered {len(names)} \([\d.]+ a second\), dropped {60 - len(names)}; ms from arrival"
    assert re.search(summary, caplog.text)


def test_frames_without_an_image_are_counted(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    (first, image), (second, _), (third, _), last, *_ = images_of(world / "runs/seq2")
    damaged: Images = [(first, image), (second, "frame 1 is damaged"), (third, image[:4]), last]
    answers, report = followed(damaged, world)
    assert [frame.name for frame, _ in answers] == [first.name, last[0].name]
    assert (report.seen, report.answered, report.unusable, report.dropped) == (4, 2, 2, 0)
    assert "unusable 2" in str(report)
    # The second is like the first, and said a moment later.
    assert caplog.text.count("frame 1 is damaged; no belief for this frame, 1 such so far") == 1
    assert "4 pixels" not in caplog.text


def test_times_that_go_back_and_times_that_are_missing(world: Path) -> None:
    images = [
        (replace(frame, time=float(-i)), image) for i, (frame, image) in enumerate(images_of(world / "runs/seq2"))
    ]
    name = images[1][0].name
    with pytest.raises(StreamError, match=f"run: frame '{name}': time goes back from -?0.000000 to -1.000000 s"):
        followed(images, world, Decoding(max_gap=5.0))
    images = [(replace(frame, time=math.nan), image) for frame, image in images]
    with pytest.raises(SourceError, match="has no time, and without one it cannot be played live"):
        followed(images, world)


@pytest.mark.parametrize("options", [Decoding(smooth=True), Decoding(viterbi=True), Decoding(explain=True)])
def test_later_words_are_not_waited_for(options: Decoding, world: Path) -> None:
    with pytest.raises(ModelError, match="live decoding answers before later words are known"):
        next(decode_live("camera:0", world / "model", words=world / "words.npz", options=options))


def test_sources_that_cannot_be_followed(world: Path) -> None:
    model, words = world / "model", world / "words.npz"
    with pytest.raises(
        StreamError, match=r"seq1.tsv: is a token stream, and live decoding is of images; name a camera"
    ):
        next(decode_live(world / "tokens/seq1.tsv", model, words=words))
    with pytest.raises(StreamError, match="runs: holds 2 sequences; name one of them to be played live"):
        next(decode_live(world / "runs", model, words=words))
