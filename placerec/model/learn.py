"""From images to a MODEL/ folder in one go, every frame described once: `placerec learn`.

The weight of words is judged with everything made anew without the sequences that judge: components, maps, models and
transitions. That costs as many trainings as there are groups of sequences, and needs the descriptors.
"""

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from placerec.errors import ModelError, VisionError
from placerec.files import whole_folder
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.table import FrameTable
from placerec.hohmm.weights import HeldOut, Weights
from placerec.jobs import Executor, Progress
from placerec.journal import open_journal
from placerec.model.evidence import chosen, count_places, group_borders, held_out
from placerec.model.folder import TOKENS, LearnedEvidence, ModelFolder, owned_by
from placerec.model.options import ModelOptions
from placerec.model.train import learn_evidence, train_folder
from placerec.vision import DescriptorSpec, DictionarySet, DictionarySetOptions, describe
from placerec.vision.chunks import Source
from placerec.vision.describe import keep_described
from placerec.vision.external import read_rows
from placerec.vision.learning import some_columns, some_rows
from placerec.vision.options import View
from placerec.words.folder import dictionary_of, each_stream, fill_folder, stream_files
from placerec.words.tokenize import streams_of_rows

log = logging.getLogger(__name__)


def learn_model(
    sources: Iterable[Path | str],
    out: Path | str,
    *,
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    words: DictionarySetOptions = DictionarySetOptions(),
    options: ModelOptions = ModelOptions(),
    left_out: Iterable[Path | str] = (),
    work: Executor | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> LearnedEvidence:
    """Learn words, models and the weight of words from image sources, and write the MODEL/ folder `out`.

    It holds words.npz and tokens/ beside what `train-lm` writes: all files are those that `train-words`, `tokenize` and
    `train-lm -w --descriptors` write. `left_out`: sequences that are to train nothing, though `sources` may name them.
    `spec`, `matrix`, `work`, `cache`, `progress`: see `placerec.vision.describe`; a run that was killed goes on from
    what it had described. `words`, `options`: of the dictionaries and of the models. Raises what these steps raise.
    """
    options.check()
    with whole_folder(Path(out), owned_by(Path(out))) as path, open_journal(Path(out)) as journal:
        kept_back = {one.source.resolve() for one in find_sequences(left_out, options=source_options)}
        sequences = [
            one for one in find_sequences(sources, options=source_options) if one.source.resolve() not in kept_back
        ]
        if not sequences:
            raise ModelError("every sequence is to be left out, and none remains to learn from; name others")
        values: Source
        if matrix is not None:
            found = describe(sequences, spec, matrix=matrix)
            spec, values, table = found.spec, found.values, found.table
        else:
            spec = spec or DescriptorSpec(kind=words.kind())
            kept = keep_described(sequences, spec, journal, work, cache, progress)
            values, table = kept.values.pieces, kept.table
        return learn_folder(ModelFolder(path), values, table, spec, words, options, work)


def learn_folder(
    folder: ModelFolder,
    values: Source,
    table: FrameTable,
    spec: DescriptorSpec,
    words: DictionarySetOptions,
    options: ModelOptions,
    work: Executor | None = None,
) -> LearnedEvidence:
    """Learn from descriptors, and write all that `learn_model` writes into a folder that is there.

    `values`: the descriptors, of `spec`, of the frames in `table`, in memory or streamed. Of several views those are
    left out, one after the other, that `hohmm.weights.Weights` calls superfluous. Arguments and errors otherwise are
    those of `learn_model`.
    """
    made = DictionarySet.fit(values, spec=spec, places=table.places, options=words, work=work)
    weights = learn_weights_anew(values, table, spec, made.options, options, work)
    view = weights.superfluous
    if view is not None:
        worth = weights.views[view]
        told = "the view %s is left out: log loss %.3f instead of %.3f without it, and less in each of %d groups"
        log.info(told, view, worth.without, weights.log_loss, worth.groups)
        views = tuple(one for one in made.options.views if one != view)
        part = spec.part(*dict.fromkeys(kind for one in views for kind in View.parse(one).part_of(spec).kinds))
        values, words = some_columns(values, spec.columns_of(part)), replace(made.options, views=views)
        return learn_folder(folder, values, table, part, words, options, work)
    names = tuple(table.by_sequence())
    made = DictionarySet(tuple(replace(one, sequences=names) for one in made.dictionaries))
    return learn_models(folder, values, table, spec, made, options, lambda: weights)


def learn_models(
    folder: ModelFolder,
    values: Source,
    table: FrameTable,
    spec: DescriptorSpec,
    dictionaries: DictionarySet,
    options: ModelOptions,
    weigh: Callable[[], Weights] | None = None,
) -> LearnedEvidence:
    """`learn_folder` with dictionaries that are there; `weigh`: as for `train_lm`."""
    dictionaries.save(folder.words)
    tokens = folder.path / TOKENS
    tokens.mkdir()
    fill_folder(streams_of_rows(values, table, dictionaries, spec), dictionaries, tokens)
    records = train_folder(folder, [tokens], options)
    return learn_evidence(folder, records, [tokens], options, weigh)


def learn_weights_anew(
    values: Source,
    table: FrameTable,
    spec: DescriptorSpec,
    words: DictionarySetOptions,
    options: ModelOptions,
    work: Executor | None = None,
) -> Weights:
    """The weights of words, with words, models and transitions redone without each group of sequences in turn.

    `values`: the descriptors of the frames in `table`, in memory or streamed. With fewer than two sequences, or where
    nothing can be learned from fewer: alpha 1 / dictionaries, memory 0.
    """

    def fit(training: Source, frames: FrameTable) -> DictionarySet:
        return DictionarySet.fit(training, spec=spec, places=frames.places, options=words, work=work)

    return learn_weights_by(fit, values, table, spec, len(words.views) * len(words.sizes), options)


def learn_weights_by(
    fit: Callable[[Source, FrameTable], DictionarySet],
    values: Source,
    table: FrameTable,
    spec: DescriptorSpec,
    dictionaries: int,
    options: ModelOptions,
) -> Weights:
    """`learn_weights_anew` for words of any making.

    `fit`: learns the `dictionaries`, as many as that, from descriptors, in memory or streamed, of some frames.
    """
    rows = table.by_sequence()
    names = list(rows)

    def held() -> Iterator[HeldOut]:
        for number, group in enumerate(group_borders(len(names))):
            left = np.zeros(len(table), bool)
            left[np.concatenate([rows[name] for name in names[group]])] = True
            training = some_rows(values, ~left)
            others = table.take(~left)
            with _unsaid():
                made = fit(training, others)
            vocabularies = {one.name: one.vocabulary for one in made.dictionaries}
            counts = count_places(streams_of_rows(training, others, made, spec), vocabularies, options)
            streams = streams_of_rows(some_rows(values, left), table.take(left), made, spec)
            views = [one.view for one in made.dictionaries]
            yield from held_out(counts, streams, vocabularies, options, number, views)

    return chosen(held(), dictionaries)


@contextmanager
def _unsaid() -> Iterator[None]:
    """What was noted of the dictionaries of all sequences is not noted again of some of them."""
    notes = logging.getLogger("placerec.vision")
    level = notes.level
    notes.setLevel(logging.ERROR)
    try:
        yield
    finally:
        notes.setLevel(level)


def weigher(
    tokens: Sequence[Path | str], words: Path | str, descriptors: Path | str, options: ModelOptions
) -> "partial[Weights]":
    """What learns the weights of token streams as `learn` does, given their words.npz and their descriptors.

    `descriptors`: an .npz of `placerec describe` that has a row for every frame. Raises VisionError for a file that
    cannot be used, and for dictionaries that are known to be others than those that made the tokens.
    """
    made, files = DictionarySet.load(words), stream_files(tokens)
    maker = dictionary_of(files)
    if maker and maker.fingerprint != made.fingerprint:
        raise VisionError(f"{words}: did not make the words in {maker.folder}; name the words.npz that made them")
    table = FrameTable.concat(stream.table for stream in each_stream(files))
    values, kept = read_rows(Path(descriptors), list(zip(table.sequences, table.names, strict=True)))
    if len(kept) < len(table):
        raise VisionError(f"{descriptors}: has rows for {len(kept)} of the {len(table)} frames; describe all of them")
    if values.shape[1] != made.spec.length:
        wanted = f"and those of {words} have {made.spec.length}; describe with --descriptor {made.spec.kind}"
        raise VisionError(f"{descriptors}: has descriptors of {values.shape[1]} values, {wanted}")
    return partial(learn_weights_anew, values, table, made.spec, made.options, options)
