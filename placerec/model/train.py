"""From sentences per place to a MODEL/ folder: one ARPA file per place, and all that made it, as text."""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

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
from placerec.lm.counts import count_texts
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN
from placerec.model.corpus import gather_corpus
from placerec.model.folder import OWNED, ModelDescription, ModelFolder
from placerec.model.options import ModelOptions
from placerec.model.record import Record
from placerec.words import Sentences, each_sentence, format_sentences, write_vocabulary

NO_PLACE = "no labelled frame found: label the frames (places.lst, or one folder per place) to train"
log = logging.getLogger(__name__)


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
    options.check()
    with whole_folder(Path(out), OWNED) as path:
        folder = ModelFolder(path)
        (path / "sentences").mkdir()

        def keep(place: str, text: Sentences) -> None:
            with folder.place(place).sentences.open("ab") as file:
                file.write(format_sentences(text).encode())

        words, record = gather_corpus(tokens, keep, selection=options.select, vocabulary=vocabulary)
        if not record.places:
            raise ModelError(NO_PLACE)
        texts = {place: each_sentence(folder.place(place).sentences) for place in record.places}
        counts = _counted(texts.values(), words, options, work)
        write_model(folder, record.places, record.places, counts, words, options, record, progress)
    log.info("%s: %d places, order %d, %s", out, len(texts), options.order, options.smoothing)


def train_model(
    sentences: Mapping[str, Sentences],
    vocabulary: Sequence[str],
    out: Path | str,
    *,
    options: ModelOptions = ModelOptions(),
    record: Record = Record(),
    work: Executor | None = None,
    progress: Progress | None = None,
) -> None:
    """Train one language model per place and write the MODEL/ folder `out`, whole or not at all.

    `record`: what model.json keeps of the training sequences. `work`: who counts (`cluster.cluster`), None for this
    process; the bytes are the same with any. Raises ModelError for no place, a bad name of a place, a word that the
    vocabulary lacks or a bad option.
    """
    _check(sentences, vocabulary, options)
    with whole_folder(Path(out), OWNED) as path:
        folder = ModelFolder(path)
        for place, text in sentences.items():
            write_text(folder.place(place).sentences, format_sentences(text))
        counts, places = _counted(sentences.values(), vocabulary, options, work), list(sentences)
        write_model(folder, places, places, counts, vocabulary, options, record, progress)


def _counted(
    texts: Iterable[Iterable[Sequence[str]]], vocabulary: Sequence[str], options: ModelOptions, work: Executor | None
) -> Iterator[NgramCounts]:
    order, markers = options.order, options.markers
    if work is not None:
        return count_texts(texts, order, vocabulary=vocabulary, markers=markers, work=work)
    return (count_ngrams(text, order, vocabulary=vocabulary, markers=markers) for text in texts)


def write_model(
    folder: ModelFolder,
    places: Sequence[str],
    estimated: Sequence[str],
    counts: Iterable[NgramCounts],
    vocabulary: Sequence[str],
    options: ModelOptions,
    record: Record,
    progress: Progress | None,
) -> None:
    """Write what MODEL/ holds beside the files of sentences, which are there when the counts of a place are.

    `estimated`: which `places` get new models, of their `counts`; those of the others come from elsewhere.
    """
    for name in ("sentences", "counts"):
        (folder.path / name).mkdir(exist_ok=True)
    write_vocabulary(vocabulary, folder.vocabulary)
    if not options.markers:
        write_text(folder.path / "nonevents.txt", SENTENCE_END + "\n")
    for done, (counted, place) in enumerate(zip(counts, estimated, strict=True), start=1):
        files = folder.place(place)
        if not files.sentences.stat().st_size:
            log.warning("place %s: no visit holds a selected word; its model is uniform", place)
        try:
            model = estimate_place(counted, options)
        except LanguageModelError as error:
            raise LanguageModelError(f"place {place}: {error}") from error
        write_text(files.counts, format_counts(counted))
        write_arpa(model, files.arpa, comment=options.signature(place, len(vocabulary)))
        if progress:
            progress(done, len(estimated))
    ModelDescription.of(folder, places, len(vocabulary), options, record).write()


def _check(sentences: Mapping[str, Sentences], vocabulary: Sequence[str], options: ModelOptions) -> None:
    options.check()
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
