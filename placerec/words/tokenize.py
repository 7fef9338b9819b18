"""From images to token streams: the word of every frame."""

import logging
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.errors import counted
from placerec.files import whole_folder
from placerec.frames import SourceOptions
from placerec.frames.table import FrameTable
from placerec.jobs import Executor, Progress
from placerec.journal import Journal, open_journal
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, DictionarySet, describe
from placerec.vision.chunks import Source, chunks
from placerec.vision.describe import KeptDescriptors
from placerec.vision.sources import open_sources
from placerec.vision.storage import Arrays
from placerec.vision.work import FrameCounts, process_batches
from placerec.words.folder import OWNED, fill_folder
from placerec.words.stream import WordColumn, WordStream

log = logging.getLogger(__name__)


def tokenize(
    sources: Iterable[Path | str],
    words: Path | str,
    out: Path | str,
    *,
    matrix: Path | str | None = None,
    network: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    work: Executor | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> None:
    """`placerec tokenize`: write the tokens folder `out` (one .tsv per sequence, vocab.txt) of image sources.

    The sources may be files of `placerec describe` (.npz), all of them, in place of images. `words`: the words.npz to
    use. `matrix`: the frames' descriptors, for a dictionary of descriptors that were computed elsewhere (`describe`).
    `network`: the file of the image network, for a dictionary of one (`DictionarySet.load`).
    `work`: who does the work (`jobs.workers`), None for threads; the bytes do not depend on it. `cache`: see
    `describe`. Only some frames at a time are in memory; after a run that was killed or interrupted the next one goes
    on from there.
    """
    dictionaries = DictionarySet.load(Path(words), network=network)
    # The folder comes first: that it cannot be written must not be found out after an hour of images.
    with whole_folder(Path(out), OWNED) as folder, open_journal(Path(out)) as journal:
        parts = _parts(sources, dictionaries, matrix, source_options, work, journal, cache, progress)
        names, seen = fill_folder(parts, dictionaries, folder)
    listed = sum(len(dictionary.vocabulary) for dictionary in dictionaries.dictionaries)
    log.info("%s: %s, %d of %d words seen", out, counted(len(names), "sequence"), len(seen), listed)


def streams_of(
    sources: Iterable[Path | str],
    dictionary: Dictionary | DictionarySet,
    *,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    work: Executor | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> list[WordStream]:
    """The token streams of sources: each frame's best-matching unit in `dictionary`, or in each of a set.

    `sources`, `matrix`, `work`, `cache`: see `tokenize`. Raises VisionError for a dictionary that needs a matrix if
    there is none.
    """
    pieces: dict[str, list[WordStream]] = {}
    for part in _parts(sources, DictionarySet.of(dictionary), matrix, source_options, work, None, cache, progress):
        pieces.setdefault(part.name, []).append(part)
    return [WordStream.concat(parts) for parts in pieces.values()]


def tokens_of(descriptors: Descriptors, dictionary: Dictionary | DictionarySet) -> list[WordStream]:
    """The token streams of described frames, one per sequence."""
    return streams_of_rows(descriptors.values, descriptors.table, DictionarySet.of(dictionary), descriptors.spec)


def streams_of_rows(
    values: Source, table: FrameTable, dictionaries: DictionarySet, spec: DescriptorSpec
) -> list[WordStream]:
    """The token streams of the frames in `table`, one per sequence, given their descriptors, in memory or streamed.

    `spec`: of the descriptors, among which those of the dictionaries must be; VisionError otherwise.
    """
    pieces: dict[str, list[WordStream]] = {}
    first = 0
    for rows in chunks(values):
        part = table.take(slice(first, first + len(rows)))
        first += len(rows)
        found = dictionaries.words(Descriptors(spec, rows, part))
        for name, own in part.by_sequence().items():
            words = [(units[own], far[own]) for units, far in found]
            pieces.setdefault(name, []).append(_stream(part.take(own), dictionaries, words))
    return [WordStream.concat(parts) for parts in pieces.values()]


def _stream(table: FrameTable, dictionaries: DictionarySet, found: Iterable[tuple[Ints, Singles]]) -> WordStream:
    """The stream of a sequence; `found`: units and distances of its frames in each dictionary."""
    first, *further = (
        WordColumn(tuple(map(dictionary.vocabulary.__getitem__, units.tolist())), distances.astype(float))
        for dictionary, (units, distances) in zip(dictionaries.dictionaries, found, strict=True)
    )
    named = dict(zip(dictionaries.names[1:], further, strict=True))
    return WordStream(table.sequences[0], table, first.words, first.distances, named)


def _looked_up(dictionaries: DictionarySet, values: Singles) -> Arrays:
    """Of m descriptors the units int64 (m, D) and distances float32 (m, D) in each of D dictionaries."""
    units, distances = zip(*dictionaries.words(values), strict=True)
    return {"units": np.stack(units, axis=1), "distances": np.stack(distances, axis=1)}


def _parts(
    sources: Iterable[Path | str],
    dictionaries: DictionarySet,
    matrix: Path | str | None,
    source_options: SourceOptions,
    work: Executor | None,
    journal: Journal | None,
    cache: Path | str | None,
    progress: Progress | None,
) -> Iterator[WordStream]:
    """Pieces of the token streams, those of a sequence one after the other."""
    sequences = open_sources(sources, source_options, dictionaries.spec, matrix, endless=True)
    if isinstance(sequences, KeptDescriptors):
        yield from streams_of_rows(sequences.values.pieces, sequences.table, dictionaries, sequences.spec)
        return
    names = set()
    if matrix is not None:
        parts = iter(tokens_of(describe(sequences, dictionaries.spec, matrix=matrix), dictionaries))
    else:
        found = process_batches(
            sequences,
            dictionaries.spec,
            FrameCounts(),
            then=partial(_looked_up, dictionaries),
            key=dictionaries.fingerprint,
            work=work,
            journal=journal,
            cache=cache,
            progress=progress,
        )
        parts = (
            _stream(table, dictionaries, zip(arrays["units"].T, arrays["distances"].T, strict=True))
            for table, arrays in found
            if len(table)
        )
    for part in parts:
        names.add(part.name)
        yield part
    for name in sorted({sequence.name for sequence in sequences} - names):
        log.warning("%s: none of its images can be read; the sequence is left out", name)
