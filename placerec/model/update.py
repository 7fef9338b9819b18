"""Learning on the robot: labelled visits are added to a MODEL/ folder, or taken away, without the old recordings.

Counts are sums over visits, so the new visits are counted and added to, or taken from, the counts files. Only the
models of their places are estimated again; the files of other places stay as they are.
"""

import logging
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, chain, pairwise
from pathlib import Path

from placerec.errors import LanguageModelError, ModelError, StreamError
from placerec.files import held_folder, read_text, restore_folder, whole_folder, write_text
from placerec.frames.find import MAX_DEPTH
from placerec.frames.folder import holds_images
from placerec.frames.naming import with_parent
from placerec.frames.places import check_twins
from placerec.jobs import Progress
from placerec.lm import NgramCounts, count_ngrams
from placerec.lm.counts import add_counts, read_counts, subtract_counts
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, Vocabulary
from placerec.model.corpus import Corpus, holds_sentences, read_corpus
from placerec.model.folder import MODEL_JSON, TOKENS, WORDS, ModelDescription, ModelFolder, owned_by
from placerec.model.options import ModelOptions
from placerec.model.record import Record, add_record, take_away
from placerec.model.train import write_model
from placerec.words import format_sentences, read_vocabulary
from placerec.words.folder import check_dictionary, no_streams, stream_files
from placerec.words.stream import FIRST, stream_name

# The sentences of a place, as in its file.
Lines = list[str]
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Model:
    """A MODEL/ folder as far as learning goes on from it."""

    folder: ModelFolder
    options: ModelOptions
    vocabulary: Sequence[str] = field(repr=False)
    record: Record = field(repr=False)
    calibrated: bool


def update(
    model: Path | str,
    tokens: Sequence[Path | str],
    *,
    forget: bool = False,
    progress: Progress | None = None,
) -> None:
    """`placerec update`: add the labelled visits in `tokens` to a MODEL/ folder, or take them away to `forget` them.

    `tokens`: token streams, or a folder of sentences if the model was trained on one. The folder then holds what
    training on all sequences, the old ones first, would have written, without the calibration. It is replaced in one
    step, and sequences that were all learned before, under the same names with the same sentences, change nothing:
    whoever was killed may run it again. Raises ModelError, StreamError or LanguageModelError, and leaves the model as
    it was, for visits that do not belong to the model, for others of a name that it knows already (or for a name that
    it does not know, to forget), and for a folder that was edited.
    """
    path = Path(model)
    restore_folder(path)
    if not path.is_dir():
        raise ModelError(f"{path}: no such model folder; `placerec train-lm TOKENS... -o {path}` makes one")
    with held_folder(path):
        evidence = ModelDescription.read(path / MODEL_JSON).evidence
        dictionaries = [*evidence.dictionaries] if evidence else [FIRST]
        olds = [_read_model(ModelFolder(path).of(name)) for name in dictionaries]
        news = [_read_visits(tokens, old) for old in olds]
        names = ", ".join(news[0].record.names)
        if not forget and all(map(_knows, olds, news)):
            log.info("%s: has learned %s already; nothing is changed", path, names)
            return
        with whole_folder(path, owned_by(path)) as made:
            for old, new in zip(olds, news, strict=True):
                folder = ModelFolder(made).of(old.folder.dictionary)
                folder.path.mkdir(exist_ok=True)
                changed = _write_changed(folder, old, new, tokens, forget, progress)
            if evidence is not None:
                frames = _added_frames(evidence.frames, news[0].record.frames, forget)
                ModelFolder(made).describe(evidence=replace(evidence, frames=frames).as_dict())
            for name in (WORDS, TOKENS):
                _copy(path / name, made / name)
    if olds[0].calibrated:
        log.warning("%s: the calibration was of the former model, and is dropped; calibrate again", path)
    log.info(
        "%s: %s %s; estimated again: %s",
        path,
        "forgotten" if forget else "learned",
        names,
        ", ".join(changed) or "nothing",
    )
    if evidence is not None:
        log.info("%s: the weight of words stays as it was learned; train again to learn it anew", path)


def _write_changed(
    folder: ModelFolder,
    old: _Model,
    new: Corpus,
    tokens: Sequence[Path | str],
    forget: bool,
    progress: Progress | None,
) -> list[str]:
    """Write what a dictionary's models become into a new `folder`; the places whose models were estimated again."""
    record = _without(old, new.record) if forget else _with(old, new.record, tokens)
    former = set(old.record.places)
    changed = [place for place in record.places if new.sentences.get(place) or place not in former]

    def counted() -> Iterator[NgramCounts]:
        for place in set(record.places) - set(changed):
            for source, target in zip(old.folder.place(place), folder.place(place), strict=True):
                shutil.copyfile(source, target)
        for place in changed:
            lines, counts = _forgotten(old, new, place) if forget else _learned(old, new, place)
            write_text(folder.place(place).sentences, "".join(lines))
            yield counts

    write_model(folder, record.places, changed, counted(), old.vocabulary, old.options, record, progress)
    return changed


def _added_frames(frames: Mapping[str, int], added: Mapping[str, int], forget: bool) -> dict[str, int]:
    """The labelled frames of each place with others added, or taken away; places that are left with some."""
    total = Counter(frames)
    total.update({place: -count if forget else count for place, count in added.items()})
    return {place: count for place, count in sorted(total.items()) if count > 0}


def _copy(source: Path, target: Path) -> None:
    """A file or folder of files, if it is there."""
    if source.is_dir():
        shutil.copytree(source, target)
    elif source.exists():
        shutil.copyfile(source, target)


def _read_model(folder: ModelFolder) -> _Model:
    """What the models of a dictionary say of themselves, if their visits can be told apart and no file is missing."""
    description = ModelDescription.read(folder.path / MODEL_JSON)
    record = description.record
    for file in (file for place in record.places for file in folder.place(place)):
        if not file.is_file():
            raise ModelError(f"{file}: missing, though {MODEL_JSON} names visits to its place; train the model again")
    calibrated = description.values.get("calibration") is not None
    return _Model(folder, description.options, read_vocabulary(folder.vocabulary), record, calibrated)


def _read_visits(tokens: Sequence[Path | str], old: _Model) -> Corpus:
    """The labelled visits in `tokens`, if they are in the model's words and of the kind that it was trained on."""
    streams = old.record.transitions is not None
    if streams == holds_sentences(tokens):
        if streams and holds_images(Path(tokens[0]), MAX_DEPTH):
            raise no_streams(Path(tokens[0]), "holds no token stream (.tsv)")
        kind = "token streams" if streams else "a folder of sentences"
        raise StreamError(f"{tokens[0]}: is not what {old.folder} was trained on; give {kind}")
    if streams:
        trained_on = {old.folder.dictionary: old.record.dictionary}
        check_dictionary(stream_files(tokens), trained_on, old.folder.path)
    return read_corpus(
        tokens,
        selection=old.options.select,
        vocabulary=old.folder.vocabulary,
        dictionary=old.folder.dictionary,
        remedy=f"tokenize as {old.folder} was, or train a model on all words",
    )


def _knows(old: _Model, new: Corpus) -> bool:
    """Whether the model has learned these very sequences."""
    visits = {sequence.name: sequence.visits for sequence in old.record.sequences}
    if not new.record.names or any(visits.get(s.name) != s.visits for s in new.record.sequences):
        return False
    for place in new.record.places:
        text = read_text(old.folder.place(place).sentences, ModelError)
        blocks = _blocks(old.record, place, text.splitlines(keepends=True))
        given = _blocks(new.record, place, _lines(new, place))
        if any(blocks[name] != block for name, block in given.items()):
            return False
    return True


def _with(old: _Model, new: Record, tokens: Sequence[Path | str]) -> Record:
    """The record with `new` sequences, if they are new and their places fit beside the old ones."""
    learned = set(old.record.names)
    streams = stream_files(tokens) if old.record.transitions is not None else []
    # A stream has its folder's name in front, or not, as others beside it are called: it is learned once under both.
    both = ((stream_name(path), with_parent(stream_name(path), path)) for path in streams)
    for name in chain(new.names, *both):
        if name in learned:
            raise ModelError(
                f"{name}: {old.folder} has learned a sequence of this name; rename the file of another one"
            )
    if not new.places:
        raise ModelError("no labelled frame found: label the frames (places.lst, or one folder per place) to learn")
    check_twins((p, s.name) for s in (*old.record.sequences, *new.sequences) for p in s.visits)
    return add_record(old.record, new)


def _without(old: _Model, gone: Record) -> Record:
    """The record without sequences that were learned, and that gave then as many visits as they give now."""
    learned = {sequence.name: sequence.visits for sequence in old.record.sequences}
    for sequence in gone.sequences:
        if sequence.name not in learned:
            raise ModelError(
                f"{sequence.name}: {old.folder} never learned a sequence of this name; see its {MODEL_JSON}"
            )
        if sequence.visits != learned[sequence.name]:
            raise _not_as_learned(sequence.name)
    record = take_away(old.record, gone)
    if not record.places:
        raise ModelError(
            f"{old.folder}: has learned nothing else, and a model has one place at least; remove the folder"
        )
    return record


def _not_as_learned(name: str) -> ModelError:
    return ModelError(
        f"{name}: its visits are not those that were learned; forget it with the words and labels of then"
    )


def _learned(old: _Model, new: Corpus, place: str) -> tuple[Lines, NgramCounts]:
    """The sentences of a place with the new ones behind, and their counts."""
    lines, counts = _lines(new, place), _count(old, new, place)
    if place not in old.record.places:
        return lines, counts
    former, former_counts = _read_place(old, place, counts.trie.vocabulary)
    return former + lines, add_counts(former_counts, counts)


def _forgotten(old: _Model, gone: Corpus, place: str) -> tuple[Lines, NgramCounts]:
    """The sentences of a place without those that are to be forgotten, and their counts."""
    counts = _count(old, gone, place)
    former, former_counts = _read_place(old, place, counts.trie.vocabulary)
    blocks = _blocks(old.record, place, former)
    for name, block in _blocks(gone.record, place, _lines(gone, place)).items():
        if blocks.pop(name) != block:
            raise _not_as_learned(name)
    try:
        return [line for block in blocks.values() for line in block], subtract_counts(former_counts, counts)
    except LanguageModelError as error:
        raise _edited(old.folder.place(place).counts, str(error)) from error


def _blocks(record: Record, place: str, lines: Lines) -> dict[str, Lines]:
    """The sentences of a place that each sequence gave."""
    ends = [0, *accumulate(sequence.visits.get(place, 0) for sequence in record.sequences)]
    return {name: lines[start:end] for name, (start, end) in zip(record.names, pairwise(ends), strict=True)}


def _read_place(model: _Model, place: str, vocabulary: Vocabulary) -> tuple[Lines, NgramCounts]:
    """The sentences and counts of a place; ModelError if they do not agree, with each other and with model.json."""
    files = model.folder.place(place)
    lines = read_text(files.sentences, ModelError).splitlines(keepends=True)
    counts = read_counts(files.counts, vocabulary, model.options.order)
    visits = sum(sequence.visits.get(place, 0) for sequence in model.record.sequences)
    if len(lines) != visits:
        raise _edited(files.sentences, f"holds {len(lines)} sentences, and {MODEL_JSON} names {visits}")
    words = sum(len(line.split()) for line in lines)
    counted = counts.counts[0][~vocabulary.mask([SENTENCE_START, SENTENCE_END])].sum()
    if words != counted:
        raise _edited(files.counts, f"counts {counted} words, and {files.sentences} holds {words}")
    return lines, counts


def _edited(path: Path, what: str) -> ModelError:
    return ModelError(f"{path}: {what}, as after an edit; train the model again")


def _lines(corpus: Corpus, place: str) -> Lines:
    return format_sentences(corpus.sentences[place]).splitlines(keepends=True)


def _count(model: _Model, corpus: Corpus, place: str) -> NgramCounts:
    order, markers = model.options.order, model.options.markers
    return count_ngrams(corpus.sentences[place], order, vocabulary=model.vocabulary, markers=markers)
