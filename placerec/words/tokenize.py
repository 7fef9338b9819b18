"""From images to token streams: the word of every frame."""

import logging
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from placerec.arrays import Ints, Singles
from placerec.files import whole_folder
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.images import Batch
from placerec.frames.table import FrameTable
from placerec.jobs import Executor, Progress
from placerec.journal import Journal, open_journal
from placerec.vision import Descriptors, Dictionary, describe
from placerec.vision.work import BatchResult, FrameCounts, describe_batch, process_batches
from placerec.words.folder import OWNED, fill_folder
from placerec.words.stream import WordStream

log = logging.getLogger(__name__)


def tokenize(
    sources: Iterable[Path | str],
    words: Path | str,
    out: Path | str,
    *,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    work: Executor | None = None,
    progress: Progress | None = None,
) -> None:
    """`placerec tokenize`: write the tokens folder `out` (one .tsv per sequence, vocab.txt) of image sources.

    `words`: the words.npz to use. `matrix`: the frames' descriptors, for a dictionary of descriptors that were computed
    elsewhere (`describe`). `work`: who does the work (`jobs.workers`), None for threads; the bytes do not depend on
    it. Only some frames at a time are in memory; after a run that was killed or interrupted the next one goes on from
    there.
    """
    dictionary = Dictionary.load(Path(words))
    # The folder comes first: that it cannot be written must not be found out after an hour of images.
    with whole_folder(Path(out), OWNED) as folder, open_journal(Path(out)) as journal:
        parts = _parts(sources, dictionary, matrix, source_options, work, journal, progress)
        names, seen = fill_folder(parts, dictionary, folder)
    log.info("%s: %d sequences, %d of %d words seen", out, len(names), len(seen), len(dictionary.vocabulary))


def streams_of(
    sources: Iterable[Path | str],
    dictionary: Dictionary,
    *,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    work: Executor | None = None,
    progress: Progress | None = None,
) -> list[WordStream]:
    """The token streams of image sources: each frame's best-matching unit in `dictionary`.

    `matrix`, `work`: see `tokenize`. Raises VisionError for a dictionary that needs a matrix if there is none.
    """
    pieces: dict[str, list[WordStream]] = {}
    for part in _parts(sources, dictionary, matrix, source_options, work, None, progress):
        pieces.setdefault(part.name, []).append(part)
    return [WordStream.concat(parts) for parts in pieces.values()]


def tokens_of(descriptors: Descriptors, dictionary: Dictionary) -> list[WordStream]:
    """The token streams of described frames, one per sequence."""
    units, distances = dictionary.words(descriptors)
    return [
        _stream(descriptors.table.take(rows), dictionary, units[rows], distances[rows])
        for rows in descriptors.table.by_sequence().values()
    ]


def _stream(table: FrameTable, dictionary: Dictionary, units: Ints, distances: Singles) -> WordStream:
    words = tuple(map(dictionary.vocabulary.__getitem__, units.tolist()))
    return WordStream(table.sequences[0], table, words, distances.astype(float))


def tokenize_batch(dictionary: Dictionary, batch: Batch) -> BatchResult:
    """The units int64 (m,) and distances float32 (m,) of a batch's frames: a function of its arguments alone."""
    found = describe_batch(dictionary.spec, batch)
    units, distances = dictionary.words(found.arrays["values"])
    return BatchResult(found.kept, found.blank, found.reasons, {"units": units, "distances": distances})


def _parts(
    sources: Iterable[Path | str],
    dictionary: Dictionary,
    matrix: Path | str | None,
    source_options: SourceOptions,
    work: Executor | None,
    journal: Journal | None,
    progress: Progress | None,
) -> Iterator[WordStream]:
    """Pieces of the token streams, those of a sequence one after the other."""
    sequences = find_sequences(sources, options=source_options, endless=True)
    names = set()
    if matrix is not None:
        parts = iter(tokens_of(describe(sequences, dictionary.spec, matrix=matrix), dictionary))
    else:
        found = process_batches(
            partial(tokenize_batch, dictionary),
            sequences,
            dictionary.spec,
            FrameCounts(),
            key=dictionary.fingerprint,
            work=work,
            journal=journal,
            progress=progress,
        )
        parts = (
            _stream(table, dictionary, arrays["units"], arrays["distances"]) for table, arrays in found if len(table)
        )
    for part in parts:
        names.add(part.name)
        yield part
    for name in sorted({sequence.name for sequence in sequences} - names):
        log.warning("%s: none of its images can be read; the sequence is left out", name)
