"""From sentences per place to a MODEL/ folder: one ARPA file per place, and all that made it, as text.

MODEL/PLACE.arpa             the language models: all that `decode` computes with
MODEL/model.json             places, options, and the equivalent `ngram-count` commands
MODEL/vocab.txt              all words
MODEL/sentences/PLACE.txt    what was counted
MODEL/counts/PLACE.counts    the counts
MODEL/nonevents.txt          without markers: what the `ngram-count` commands need to leave </s> out
"""

import json
import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from placerec.errors import LanguageModelError, ModelError
from placerec.files import whole_folder, write_text
from placerec.frames.places import check_place, check_twins
from placerec.jobs import Executor, Progress
from placerec.lm import (
    BackoffModel,
    NgramCounts,
    count_ngrams,
    estimate,
    format_counts,
    smoothing,
    with_unigrams,
    write_arpa,
)
from placerec.lm.count_sums import count_texts
from placerec.lm.markers import SENTENCE_END, SENTENCE_START, UNKNOWN
from placerec.lm.smoothings import SRILM_OPTIONS, default_delta
from placerec.model.corpus import gather_corpus
from placerec.model.record import NO_RECORD, Record, describe_record
from placerec.version import __version__
from placerec.words import Selection, Sentences, each_sentence, format_sentences, write_vocabulary
from placerec.words.folder import VOCABULARY

FORMAT = "placerec model 1"
MODEL_JSON = "model.json"
OWNED = ("*.arpa", MODEL_JSON, VOCABULARY, "nonevents.txt", "sentences", "counts")
MAX_ORDER = 9
NO_PLACE = "no labelled frame found: label the frames (places.lst, or one folder per place) to train"
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ModelOptions:
    """How language models are made; every name is that of the command line.

    `order`: n-gram order (1: the classical HMM). `delta`: see `placerec.lm.smoothing`; None for its default.
    `min_count`: per order, the last repeats. `markers`: whether `<s>` and `</s>` are counted.
    """

    order: int = 2
    smoothing: str = "witten-bell"
    delta: float | None = None
    min_count: tuple[int, ...] = (1,)
    markers: bool = False
    select: Selection = Selection()


class PlaceFiles(NamedTuple):
    """The files of one place in a MODEL/ folder."""

    arpa: Path
    sentences: Path
    counts: Path

    @staticmethod
    def of(folder: Path, place: str) -> "PlaceFiles":
        return PlaceFiles(
            folder / f"{place}.arpa", folder / "sentences" / f"{place}.txt", folder / "counts" / f"{place}.counts"
        )


def parse_min_count(text: str) -> tuple[int, ...]:
    """Minimum counts per order from `N[,N...]` or `srilm` (1,1,2: what ngram-count does); ModelError otherwise."""
    if text == "srilm":
        return (1, 1, 2)
    parts = text.split(",")
    if not all(part.isascii() and part.isdigit() and int(part) > 0 for part in parts):
        raise ModelError(f"minimum count {text!r} is not understood; give numbers above 0 as in 1,1,2, or srilm")
    return tuple(int(part) for part in parts)


def estimate_place(counts: NgramCounts, options: ModelOptions) -> BackoffModel:
    """The language model of one place: V = all words of the counts' vocabulary."""
    non_events = () if options.markers else (SENTENCE_END,)
    rule = smoothing(options.smoothing, options.delta)
    model = estimate(counts, rule, min_count=options.min_count, non_events=non_events)
    return with_unigrams(model, (UNKNOWN, SENTENCE_START, SENTENCE_END))


def train_lm(
    tokens: Sequence[Path | str],
    out: Path | str,
    *,
    options: ModelOptions = ModelOptions(),
    vocabulary: Path | str | None = None,
    work: Executor | None = None,
    progress: Progress | None = None,
) -> None:
    """`placerec train-lm`: read token streams or sentences (see `gather_corpus`) and write a MODEL/ folder.

    Memory holds the model of one place and one stream; the sentences go to their files as they are read. `work`: as for
    `train_model`.
    """
    check_options(options)
    with whole_folder(Path(out), OWNED) as folder:
        (folder / "sentences").mkdir()

        def keep(place: str, text: Sentences) -> None:
            with PlaceFiles.of(folder, place).sentences.open("ab") as file:
                file.write(format_sentences(text).encode())

        words, record = gather_corpus(tokens, keep, selection=options.select, vocabulary=vocabulary)
        if not record.places:
            raise ModelError(NO_PLACE)
        texts = {place: each_sentence(PlaceFiles.of(folder, place).sentences) for place in record.places}
        _write_model(folder, texts, words, options, record, work, progress)
    log.info("%s: %d places, order %d, %s", out, len(texts), options.order, options.smoothing)


def train_model(
    sentences: Mapping[str, Sentences],
    vocabulary: Sequence[str],
    out: Path | str,
    *,
    options: ModelOptions = ModelOptions(),
    record: Record = NO_RECORD,
    work: Executor | None = None,
    progress: Progress | None = None,
) -> None:
    """Train one language model per place and write the MODEL/ folder `out`, whole or not at all.

    `record`: what model.json keeps of the training sequences. `work`: who counts (`cluster.cluster`), None for this
    process; the bytes are the same with any. Raises ModelError for no place, a bad name of a place, a word that the
    vocabulary lacks or a bad option.
    """
    _check(sentences, vocabulary, options)
    with whole_folder(Path(out), OWNED) as folder:
        for place, text in sentences.items():
            write_text(PlaceFiles.of(folder, place).sentences, format_sentences(text))
        _write_model(folder, sentences, vocabulary, options, record, work, progress)


def _write_model(
    folder: Path,
    sentences: Mapping[str, Iterable[Sequence[str]]],
    vocabulary: Sequence[str],
    options: ModelOptions,
    record: Record,
    work: Executor | None,
    progress: Progress | None,
) -> None:
    """What MODEL/ holds beside the files of sentences, which are there."""
    begin_model(folder, vocabulary, options)
    tables = _counted(sentences.values(), vocabulary, options, work)
    for done, (place, counts) in enumerate(zip(sentences, tables, strict=True), start=1):
        write_place(folder, place, counts, vocabulary, options)
        if progress:
            progress(done, len(sentences))
    write_model_json(folder, list(sentences), vocabulary, options, record)


def _counted(
    texts: Iterable[Iterable[Sequence[str]]], vocabulary: Sequence[str], options: ModelOptions, work: Executor | None
) -> Iterator[NgramCounts]:
    order, markers = options.order, options.markers
    if work is not None:
        return count_texts(texts, order, vocabulary=vocabulary, markers=markers, work=work)
    return (count_ngrams(text, order, vocabulary=vocabulary, markers=markers) for text in texts)


def begin_model(folder: Path, vocabulary: Sequence[str], options: ModelOptions) -> None:
    """Write into a new MODEL/ folder what does not depend on the places."""
    (folder / "sentences").mkdir(exist_ok=True)
    (folder / "counts").mkdir()
    write_vocabulary(vocabulary, folder / VOCABULARY)
    if not options.markers:
        write_text(folder / "nonevents.txt", SENTENCE_END + "\n")


def write_place(
    folder: Path, place: str, counts: NgramCounts, vocabulary: Sequence[str], options: ModelOptions
) -> None:
    """Write into MODEL/, beside the sentences of one place, their counts, and the model of these."""
    files = PlaceFiles.of(folder, place)
    if not files.sentences.stat().st_size:
        log.warning("place %s: no visit holds a selected word; its model is uniform", place)
    try:
        model = estimate_place(counts, options)
    except LanguageModelError as error:
        raise LanguageModelError(f"place {place}: {error}") from error
    write_text(files.counts, format_counts(counts))
    write_arpa(model, files.arpa, comment=signature(place, len(vocabulary), options))


def signature(place: str, words: int, options: ModelOptions) -> str:
    """What made a model, in one line: the first line of its ARPA file."""
    delta = f" delta={_delta(options):g}" if options.smoothing.startswith(("lidstone", "absolute")) else ""
    return (
        f"placerec {__version__} place={place} order={options.order} smoothing={options.smoothing}{delta}"
        f" select={options.select} min-count={','.join(map(str, options.min_count))}"
        f" markers={'yes' if options.markers else 'no'} vocab={words}"
    )


def ngram_count_command(place: str, options: ModelOptions) -> str | None:
    """The SRILM command that makes the same model of the same sentences, run in MODEL/; None where there is none."""
    method = SRILM_OPTIONS[options.smoothing]
    if method is None:
        return None
    minima = [options.min_count[min(n, len(options.min_count)) - 1] for n in range(1, options.order + 1)]
    return " ".join(
        [
            f"ngram-count -text sentences/{place}.txt -vocab vocab.txt",
            *([] if options.markers else ["-nonevents nonevents.txt -no-sos -no-eos"]),
            f"-order {options.order}",
            *(f"-gt{n}min {minimum}" for n, minimum in enumerate(minima, start=1)),
            method.format(delta=_delta(options)),
            f"-lm {place}.arpa",
        ]
    )


def _delta(options: ModelOptions) -> float:
    return default_delta(options.smoothing) if options.delta is None else options.delta


def write_model_json(
    folder: Path, places: Sequence[str], vocabulary: Sequence[str], options: ModelOptions, record: Record
) -> None:
    """Write the model.json of a model that is not calibrated."""
    description = {
        "format": FORMAT,
        "version": __version__,
        "places": list(places),
        "order": options.order,
        "smoothing": options.smoothing,
        "delta": _delta(options),
        "min_count": list(options.min_count),
        "markers": options.markers,
        "select": str(options.select),
        "vocabulary": len(vocabulary),
        **describe_record(record),
        "calibration": None,
        "ngram_count": {place: ngram_count_command(place, options) for place in places},
    }
    write_text(folder / MODEL_JSON, format_description(description))


def format_description(description: Mapping[str, Any]) -> str:
    """The text of model.json: what holds nothing but whole numbers is on one line, the rest as `json` indents it."""
    return _format(dict(description), "") + "\n"


def _format(value: Any, indent: str) -> str:
    inner = list(value.values()) if isinstance(value, dict) else value
    if not isinstance(value, dict | list) or all(isinstance(item, int) for item in inner):
        return json.dumps(value, ensure_ascii=False)
    texts = [_format(item, indent + "  ") for item in inner]
    if isinstance(value, dict):
        texts = [f"{json.dumps(key, ensure_ascii=False)}: {text}" for key, text in zip(value, texts, strict=True)]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return f"{opening}\n" + ",\n".join(f"{indent}  {text}" for text in texts) + f"\n{indent}{closing}"


def check_options(options: ModelOptions) -> None:
    """ModelError or LanguageModelError for an option that no model can be made with."""
    if not 1 <= options.order <= MAX_ORDER:
        raise ModelError(f"order {options.order} is not between 1 and {MAX_ORDER}")
    if not options.min_count or min(options.min_count) < 1:
        raise ModelError(f"minimum counts {options.min_count} are not understood; give numbers above 0, one at least")
    smoothing(options.smoothing, options.delta)


def _check(sentences: Mapping[str, Sentences], vocabulary: Sequence[str], options: ModelOptions) -> None:
    check_options(options)
    if not sentences:
        raise ModelError(NO_PLACE)
    for place in sentences:
        if reason := check_place(place):
            raise ModelError(f"place {place!r} {reason}; rename it")
    check_twins((place, "the training data") for place in sentences)
    listed = set(vocabulary)
    for place, text in sentences.items():
        for i, visit in enumerate(text, start=1):
            for word in visit:
                if word not in listed:
                    raise ModelError(f"place {place}, visit {i}: the word {word!r} is not in the vocabulary")
