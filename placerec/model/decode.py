"""Decoding: token streams, images or lines of words in, beliefs out."""

import json
import logging
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from placerec.errors import ModelError, OutputError, StreamError, at
from placerec.files import whole_folder, write_text
from placerec.frames import Reading
from placerec.hohmm import Beliefs, Recognizer, belief_rows, format_header, format_row
from placerec.hohmm.beliefs import UNKNOWN
from placerec.hohmm.explain import EXPLAINED, explain_stream
from placerec.jobs import Progress
from placerec.model.corpus import STREAM_SUFFIXES
from placerec.model.decoder import Decoder
from placerec.model.decoding import PAPER, Decoding
from placerec.model.load import PlaceModels, load_model
from placerec.model.recognize import make_recognizer, token_streams
from placerec.words import WordStream

OWNED = ("*.tsv", "*.jsonl")
log = logging.getLogger(__name__)


def decode(
    sources: Sequence[Path | str],
    model: Path | str,
    *,
    words: Path | str | None = None,
    out: Path | str | None = None,
    reading: Reading = Reading(),
    options: Decoding = PAPER,
    scorer: str = "native",
    as_json: bool = False,
    progress: Progress | None = None,
    make: Callable[..., Decoder] = make_recognizer,
) -> list[Beliefs]:
    """`placerec decode`: the beliefs over every sequence that `sources` name, written to the folder `out` if given.

    `sources`: token streams, or image sources (`reading`) if `words` (a words.npz) is given. Without `out` there must
    be one sequence only; explanations are written there, as NAME.explain.jsonl. `make`: what gives the decoder, for
    the arguments of `make_recognizer`. Raises ModelError or StreamError for what cannot be read or does not belong
    together.
    """
    if out is None:
        if options.explain:
            raise ModelError("explanations are files: name a folder for them with -o")
        _, recognizer, streams = _opened(sources, model, words, reading, options, scorer, progress, make)
        if len(streams) > 1:
            raise ModelError(f"{len(streams)} sequences to decode: name a folder for their beliefs with -o")
        return [_decoded(recognizer, stream, options) for stream in streams]
    _spare_sources(sources, Path(out))
    found = []
    with whole_folder(Path(out), OWNED) as folder:
        models, recognizer, streams = _opened(sources, model, words, reading, options, scorer, progress, make)
        for stream in streams:
            beliefs = _decoded(recognizer, stream, options)
            suffix = "jsonl" if as_json else "tsv"
            write_text(folder / f"{beliefs.name}.{suffix}", format_beliefs(beliefs, as_json=as_json))
            if options.explain and isinstance(recognizer, Recognizer):
                lines = explain_stream(recognizer, models.models, stream)
                text = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)
                write_text(folder / f"{beliefs.name}{EXPLAINED}", text)
            found.append(beliefs)
    log.info("%s: %d sequences, %d frames", out, len(found), sum(len(beliefs.frames) for beliefs in found))
    return found


def _opened(
    sources: Sequence[Path | str],
    model: Path | str,
    words: Path | str | None,
    reading: Reading,
    options: Decoding,
    scorer: str,
    progress: Progress | None,
    make: Callable[..., Decoder],
) -> tuple[PlaceModels, Decoder, list[WordStream]]:
    models = load_model(model)
    if words is not None:
        return models, *_image_streams(sources, Path(words), models, reading, options, scorer, progress, make)
    return models, make(models, options=options, scorer=scorer), token_streams(sources, models)


def _decoded(recognizer: Decoder, stream: WordStream, options: Decoding) -> Beliefs:
    ahead = {"smooth": options.smooth, "viterbi": options.viterbi, "lag": options.lag}
    return recognizer.decode(stream, **(ahead if options.looks_ahead else {}))


def _image_streams(
    sources: Sequence[Path | str],
    words: Path,
    models: PlaceModels,
    reading: Reading,
    options: Decoding,
    scorer: str,
    progress: Progress | None,
    make: Callable[..., Decoder],
) -> tuple[Decoder, list[WordStream]]:
    # Only images need OpenCV and scipy.
    from placerec.vision import Dictionary
    from placerec.words.tokenize import streams_of

    for source in sources:
        if str(source).endswith(STREAM_SUFFIXES):
            raise StreamError(f"{source}: is a token stream, which needs no dictionary; leave {words} out")
    dictionary = Dictionary.load(words)
    recognizer = make(models, options=options, scorer=scorer, dictionary=dictionary)
    return recognizer, streams_of(sources, dictionary, reading=reading, progress=progress)


def _spare_sources(sources: Sequence[Path | str], out: Path) -> None:
    """Refuse to write over what is to be read: token streams and beliefs are called alike."""
    for source in map(Path, sources):
        if out.resolve() in (source.resolve(), source.resolve().parent):
            raise OutputError(f"{out}: holds what is to be decoded ({source}); name another folder")


def format_beliefs(beliefs: Beliefs, *, as_json: bool = False) -> str:
    """The text of a beliefs file: TSV with a header, or one JSON object a line."""
    lines = [] if as_json else [format_header(beliefs.places, unknown=beliefs.unknown is not None)]
    lines += [format_line(beliefs.places, *row, as_json=as_json) for row in belief_rows(beliefs)]
    return "".join(f"{line}\n" for line in lines)


def decode_lines(recognizer: Decoder, lines: Iterable[str], *, as_json: bool = False) -> Iterator[str]:
    """`placerec decode -`: an answer for each line `word [TAB [seconds] [TAB distance]]`, as soon as it is read.

    The TSV header comes before the first line is read. A word that the models do not list holds the belief; the first
    one and the number of them are logged. Raises StreamError for seconds or a distance that are no number, and for
    seconds that are needed (`Recognizer.update`) and missing, or go back.
    """
    if not as_json:
        yield format_header(recognizer.places, unknown=recognizer.unknown is not None)
    strange = 0
    for frame, line in enumerate(lines):
        word, time, distance = _fields(line, frame)
        known = word in recognizer
        if not known and not strange:
            log.warning("<stdin>:%d: the word %r is not in the models' vocabulary; skipped", frame + 1, word)
        strange += not known
        try:
            belief = recognizer.update(word, time, distance) if known else recognizer.skip(time)
        except ModelError as error:
            raise StreamError(at("<stdin>", frame + 1, str(error))) from error
        row = str(frame), time, "", word, belief.selected, belief.best, belief.probability.tolist(), belief.unknown
        yield format_line(recognizer.places, *row, as_json=as_json)
    if strange:
        log.warning("<stdin>: lines skipped because the models do not list their word: %d", strange)
    if recognizer.unexplained:
        log.warning("<stdin>: words that no place explains, which left the prediction: %d", recognizer.unexplained)


def _fields(line: str, frame: int) -> tuple[str, float, float]:
    """Word, seconds and distance of line `frame` (from 0), nan for what is not there."""
    if frame == 0:
        line = line.removeprefix("\ufeff")
    word, *rest = line.rstrip("\r\n").split("\t")
    if len(rest) > 2:
        raise StreamError(at("<stdin>", frame + 1, f"{len(rest) + 1} fields; word, seconds and distance are expected"))
    seconds, distance = [*rest, "", ""][:2]
    time = _number(seconds, frame, f"time {seconds!r} is not a number of seconds")
    return word.strip(), time, _number(distance, frame, f"distance {distance!r} is not a number")


def _number(text: str, frame: int, complaint: str) -> float:
    if not text.strip():
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise StreamError(at("<stdin>", frame + 1, complaint))
    return value


def format_line(
    places: Sequence[str],
    frame: str,
    time: float,
    truth: str,
    word: str,
    selected: bool,
    best: str,
    belief: Sequence[float],
    unknown: float | None,
    *,
    as_json: bool,
) -> str:
    """One frame's line of a beliefs file, without its line end."""
    if not as_json:
        return format_row(frame, time, truth, word, selected, best, belief, unknown)
    return json.dumps(
        {
            "frame": frame,
            "time": None if math.isnan(time) else time,
            "place": truth or None,
            "word": word,
            "selected": selected,
            "best": best,
            "belief": dict(zip(places, belief, strict=True)),
            **({} if unknown is None else {UNKNOWN: unknown}),
        },
        ensure_ascii=False,
    )
