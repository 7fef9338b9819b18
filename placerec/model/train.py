"""From sentences per place to a MODEL/ folder: one ARPA file per place, and all that made it, as text."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from placerec.errors import LanguageModelError, ModelError
from placerec.files import whole_folder, write_text
from placerec.frames.places import check_place, check_twins
from placerec.hohmm.weights import Weights
from placerec.jobs import Executor, Progress
from placerec.lm import NgramCounts, count_ngrams, format_counts, write_arpa
from placerec.lm.counts import count_texts
from placerec.lm.vocabulary import SENTENCE_END
from placerec.model.corpus import dictionaries_in, gather_corpus, holds_sentences
from placerec.model.evidence import learn_weights
from placerec.model.folder import LearnedEvidence, ModelDescription, ModelFolder, owned_by
from placerec.model.options import ModelOptions, estimate_place
from placerec.model.record import Record
from placerec.words import (
    Sentences,
    each_sentence,
    format_sentences,
    read_stream,
    read_vocabulary,
    write_vocabulary,
)
from placerec.words.folder import stream_files
from placerec.words.stream import FIRST

NO_PLACE = "no labelled frame found: label the frames (places.lst, or one folder per place) to train"
log = logging.getLogger(__name__)


def train_lm(
    tokens: Sequence[Path | str],
    out: Path | str,
    *,
    options: ModelOptions = ModelOptions(),
    vocabulary: Path | str | None = None,
    as_in_paper: bool = False,
    weigh: Callable[[], Weights] | None = None,
    work: Executor | None = None,
    progress: Progress | None = None,
) -> None:
    """`placerec train-lm`: read token streams or sentences (see `gather_corpus`) and write a MODEL/ folder.

    Of token streams with words of several dictionaries each gets its models, and how much all of them weigh is learned:
    by `weigh` (such as `placerec.model.learn.learn_weights_anew`), or from the token streams alone (`learn_weights`).
    `as_in_paper`: the first dictionary alone, and nothing is learned of weights. Memory holds the model of one place
    and one stream; the sentences go to their files as they are read. `work`: as for `train_model`.
    """
    options.check()
    with whole_folder(Path(out), owned_by(Path(out))) as path:
        folder = ModelFolder(path)
        names = dictionaries_in(tokens)[: 1 if as_in_paper else None]
        records = train_folder(folder, tokens, options, vocabulary, names, work, progress)
        evidence = None
        if not as_in_paper and not holds_sentences(tokens):
            evidence = learn_evidence(folder, records, tokens, options, weigh)
    log.info("%s: %d places, order %d, %s", out, len(records[FIRST].places), options.order, options.smoothing)
    if evidence is not None:
        log.info("%s", evidence)


def train_folder(
    folder: ModelFolder,
    tokens: Sequence[Path | str],
    options: ModelOptions,
    vocabulary: Path | str | None = None,
    dictionaries: Sequence[str] | None = None,
    work: Executor | None = None,
    progress: Progress | None = None,
) -> dict[str, Record]:
    """Write the models and what goes with them into a folder that is there; the record of each dictionary, by name.

    `dictionaries`: those whose words are read, all by default. Other arguments and errors are those of `train_lm`.
    """
    names = dictionaries_in(tokens) if dictionaries is None else dictionaries
    folders = {name: folder.of(name) for name in names}
    for own in folders.values():
        (own.path / "sentences").mkdir(parents=True)

    def keep(dictionary: str, place: str, text: Sentences) -> None:
        with folders[dictionary].place(place).sentences.open("ab") as file:
            file.write(format_sentences(text).encode())

    gathered = gather_corpus(tokens, keep, selection=options.select, vocabulary=vocabulary, dictionaries=names)
    for name, (words, record) in gathered.items():
        if not record.places:
            raise ModelError(NO_PLACE)
        texts = (each_sentence(folders[name].place(place).sentences) for place in record.places)
        counts = _counted(texts, words, options, work)
        write_model(folders[name], record.places, record.places, counts, words, options, record, progress)
    return {name: record for name, (_, record) in gathered.items()}


def learn_evidence(
    folder: ModelFolder,
    records: Mapping[str, Record],
    tokens: Sequence[Path | str],
    options: ModelOptions,
    weigh: Callable[[], Weights] | None = None,
) -> LearnedEvidence:
    """Learn how much words weigh, and write it into the folder of their models, of which `records` tells.

    `tokens`: the token streams that the models were made of, which tell the weights without `weigh`, see `train_lm`.
    """
    if weigh is None:
        vocabularies = {name: read_vocabulary(folder.of(name).vocabulary) for name in records}
        weights = learn_weights([partial(read_stream, path) for path in stream_files(tokens)], vocabularies, options)
    else:
        weights = weigh()
    fingerprints = {name: record.dictionary for name, record in records.items()}
    first = records[FIRST]
    evidence = LearnedEvidence(weights, len(first.sequences), first.frames, fingerprints, weigh is not None)
    folder.describe(evidence=evidence.as_dict())
    return evidence


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
    with whole_folder(Path(out), owned_by(Path(out))) as path:
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
    if len(places) == 1:
        log.warning("%s is the only place, and will be recognised wherever the camera is; label others, too", places[0])
    if not options.markers:
        write_text(folder.path / "nonevents.txt", SENTENCE_END + "\n")
    for done, (counted, place) in enumerate(zip(counts, estimated, strict=True), start=1):
        files = folder.place(place)
        if not files.sentences.stat().st_size:
            log.warning("place %s: no visit holds a selected word; its model is uniform", place)
        try:
            held_out = [*each_sentence(files.sentences)] if options.holds_out else []
            model = estimate_place(counted, options, held_out)
        except LanguageModelError as error:
            raise LanguageModelError(f"place {place}: {error}") from error
        write_text(files.counts, format_counts(counted))
        write_arpa(model, files.arpa, comment=options.signature(place, len(vocabulary), folder.dictionary))
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
