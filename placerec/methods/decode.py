"""Decoding: token streams, images or lines of words in, beliefs out."""

import json
import logging
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from placerec.errors import ModelError, OutputError, StreamError, at, counted
from placerec.files import number_in, whole_folder, write_text
from placerec.frames import SourceOptions
from placerec.frames.doubts import warn_of_strange_labels, warn_of_training
from placerec.hohmm import Belief, Recognizer, SequenceDecoder
from placerec.hohmm.beliefs import BeliefRow, Beliefs, format_beliefs, format_header, format_json_row, format_row
from placerec.hohmm.explain import EXPLAINED
from placerec.jobs import Progress
from placerec.methods.decoders import HOHMM, check_method, make_decoder
from placerec.methods.made_by import BELIEFS_JSON, describe_making
from placerec.model import Decoding, PlaceModels, load_model
from placerec.model.decoding import AS_LEARNED, ScorerName, token_streams
from placerec.words import WordStream
from placerec.words.folder import dictionary_of, is_stream, stream_files

if TYPE_CHECKING:
    from placerec.vision import DictionarySet

OWNED = ("*.tsv", "*.jsonl", BELIEFS_JSON)
log = logging.getLogger(__name__)


def decode(
    sources: Sequence[Path | str],
    model: Path | str,
    *,
    method: str = HOHMM,
    words: Path | str | None = None,
    network: Path | str | None = None,
    out: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    options: Decoding = AS_LEARNED,
    scorer: ScorerName = "native",
    as_json: bool = False,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> list[Beliefs]:
    """`placerec decode`: the beliefs over every sequence that `sources` name, written to the folder `out` if given.

    `sources`: token streams, or image sources (`source_options`), whose words come from `words` (a words.npz; by
    default that in `model`; `network`: the file of the image network, for words of one). Without `out` there must be
    one sequence only; explanations are written there, as NAME.explain.jsonl. `method`: one of `METHODS`. `cache`: see
    `placerec.vision.describe`. Labelled sequences that trained words or models are named in a warning, and so are
    labels that the models do not know. Raises ModelError or StreamError for what cannot be read or does not belong
    together.
    """

    check_method(method, options, scorer=scorer)

    def opened() -> tuple[SequenceDecoder, list[WordStream], PlaceModels]:
        models = load_model(model)
        dictionary = _dictionary_for(sources, words, models, network)
        decoder = make_decoder(method, models, options=options, scorer=scorer, dictionary=dictionary)
        streams, trained = _streams_of(sources, models, dictionary, source_options, cache, progress)
        if out is None and len(streams) > 1:
            raise ModelError(f"{len(streams)} sequences to decode: name a folder for their beliefs with -o")
        _doubt(streams, models, trained, options)
        return decoder, streams, models

    if out is None:
        if options.explain:
            raise ModelError("explanations are files: name a folder for them with -o")
        decoder, streams, _ = opened()
        return [_decoded(decoder, stream, options) for stream in streams]
    _spare_sources(sources, Path(out))
    found = []
    with whole_folder(Path(out), OWNED) as folder:
        decoder, streams, models = opened()
        write_text(folder / BELIEFS_JSON, describe_making(method, models, options))
        for stream in streams:
            found.append(_decoded(decoder, stream, options))
            _write(folder, decoder, stream, found[-1], options, as_json)
    frames = counted(sum(map(len, found)), "frame")
    log.info("%s: %s, %s", out, counted(len(found), "sequence"), frames)
    return found


def _write(
    folder: Path, decoder: SequenceDecoder, stream: WordStream, beliefs: Beliefs, options: Decoding, as_json: bool
) -> None:
    suffix = "jsonl" if as_json else "tsv"
    write_text(folder / f"{stream.name}.{suffix}", format_beliefs(beliefs, as_json=as_json))
    if options.explain and isinstance(decoder, Recognizer):
        decisions = (json.dumps(one, ensure_ascii=False) + "\n" for one in decoder.explain_stream(stream))
        write_text(folder / f"{stream.name}{EXPLAINED}", "".join(decisions))


def _dictionary_for(
    sources: Sequence[Path | str], words: Path | str | None, models: PlaceModels, network: Path | str | None
) -> "DictionarySet | None":
    """The dictionaries in `words`, by default those of the models for images; None where token streams need none."""
    own = models.folder.words
    path = words or (own if own.exists() and are_images(sources) else None)
    if path is None:
        return None
    # Only images need OpenCV and scipy.
    from placerec.vision import DictionarySet

    for source in sources:
        if is_stream(Path(source)):
            raise StreamError(f"{source}: is a token stream, which needs no dictionary; leave {path} out")
    return DictionarySet.load(path, network=network)


def _streams_of(
    sources: Sequence[Path | str],
    models: PlaceModels,
    dictionary: "DictionarySet | None",
    source_options: SourceOptions,
    cache: Path | str | None,
    progress: Progress | None,
) -> tuple[list[WordStream], Collection[str]]:
    """The words of every sequence, and the names of the sequences that trained the words, as far as they are known."""
    if dictionary is None:
        streams, maker = token_streams(sources, models), dictionary_of(stream_files(sources))
        return streams, maker.trained_on if maker else ()
    from placerec.words.tokenize import streams_of

    streams = streams_of(sources, dictionary, source_options=source_options, cache=cache, progress=progress)
    return streams, dictionary.sequences


def are_images(sources: Sequence[Path | str]) -> bool:
    """Whether sources are no token streams, hold none, and are no text."""
    paths = [*map(Path, sources)]
    return not any(is_stream(path) or path.suffix == ".txt" or _holds_streams(path) for path in paths)


def _holds_streams(path: Path) -> bool:
    return path.is_dir() and any(map(is_stream, path.iterdir()))


def _doubt(
    streams: Sequence[WordStream], models: PlaceModels, trained_words: Collection[str], options: Decoding
) -> None:
    labelled = [stream.name for stream in streams if any(stream.places)]
    warn_of_training([name for name in labelled if name in models.description.trained_on], "models")
    warn_of_training([name for name in labelled if name in trained_words], "words")
    warn_of_strange_labels((stream.places for stream in streams), [*models.models], options.unknown)


def _decoded(decoder: SequenceDecoder, stream: WordStream, options: Decoding) -> Beliefs:
    # Other methods were checked to be asked for nothing of it.
    if isinstance(decoder, Recognizer):
        return decoder.decode(stream, smooth=options.smooth, viterbi=options.viterbi, lag=options.lag)
    return decoder.decode(stream)


def _spare_sources(sources: Sequence[Path | str], out: Path) -> None:
    """Refuse to write over what is to be read: token streams and beliefs are called alike."""
    for source in map(Path, sources):
        if out.resolve() in (source.resolve(), source.resolve().parent):
            raise OutputError(f"{out}: holds what is to be decoded ({source}); name another folder")


def decode_lines(decoder: SequenceDecoder, lines: Iterable[str], *, as_json: bool = False) -> Iterator[str]:
    """`placerec decode -`: an answer for each line `word [TAB [seconds] [TAB distance]]`, as soon as it is read.

    Of a decoder of several dictionaries a line has a word of each, with blanks between them, in any order. The TSV
    header comes before the first line is read. A word that the models do not list holds the belief; the first one and
    the number of them are logged. Raises StreamError for seconds or a distance that are no number, and for seconds that
    are needed (`SequenceDecoder.update`) and missing, or go back.
    """
    if not as_json:
        yield format_header(decoder.places, unknown=decoder.asks_unknown)
    strange = 0
    for frame, line in enumerate(lines):
        word, time, distance = _fields(line, frame)
        words = word.split() if decoder.several else [word]
        for one in words or [word]:
            if one not in decoder:
                if not strange:
                    log.warning("<stdin>:%d: the word %r is not in the models' vocabulary; skipped", frame + 1, one)
                strange += 1
        try:
            belief = decoder.answer(words or [word], time, distance)
        except ModelError as error:
            raise StreamError(at("<stdin>", frame + 1, str(error))) from error
        yield format_belief(str(frame), time, "", belief, as_json=as_json)
    if strange:
        log.warning("<stdin>: lines skipped because the models do not list their word: %d", strange)
    if never := decoder.zero_likelihood_words:
        log.warning("<stdin>: words that no place explains, which left the prediction: %d", never)


def format_belief(frame: str, time: float, place: str, belief: Belief, *, as_json: bool) -> str:
    """The line of a beliefs file for one frame, its time in seconds and its label, without the line end."""
    numbers = belief.probability.tolist(), belief.unknown
    row = BeliefRow(frame, time, place, belief.word, belief.selected, belief.best, *numbers)
    return format_json_row(belief.places, row) if as_json else format_row(row)


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
    value = number_in(text)
    if not math.isfinite(value):
        raise StreamError(at("<stdin>", frame + 1, complaint))
    return value
