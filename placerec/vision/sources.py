"""The whole way from image sources to a file: what `placerec describe` and `placerec train-words` do."""

import logging
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from pathlib import Path

from placerec.errors import OutputError
from placerec.files import whole_file
from placerec.frames import Sequence, SourceOptions, files_of, find_sequences
from placerec.jobs import Executor, Progress
from placerec.journal import open_journal
from placerec.vision.chunks import Source
from placerec.vision.describe import describe, keep_described, save_descriptors
from placerec.vision.dictionary_set import DictionarySet
from placerec.vision.learning import Quality
from placerec.vision.options import DictionaryOptions, DictionarySetOptions
from placerec.vision.som import MapQuality
from placerec.vision.spec import DescriptorSpec

log = logging.getLogger(__name__)


def describe_sources(
    sources: Iterable[Path | str],
    out: Path | str,
    *,
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    work: Executor | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the descriptors of all frames of the sources to `out`; `progress` is called with frames done and in all.

    `spec`, `matrix`, `work`: as for `describe`. The descriptors are kept in a file beside `out` while the work goes
    on, not in memory; after a run that was killed or interrupted the next one goes on from there. Raises SourceError
    for sources and VisionError for images or a matrix that cannot be used, OutputError for the file.
    """
    # The file comes first: that it cannot be written must not be found out after an hour of images.
    with whole_file(Path(out)) as unfinished, open_journal(Path(out)) as journal:
        sequences = find_sequences(sources, options=source_options)
        _check_unread(Path(out), sequences, matrix)
        if matrix is not None:
            save_descriptors(describe(sequences, spec, matrix=matrix), unfinished)
            return
        spec = spec or DescriptorSpec()
        save_descriptors(keep_described(sequences, spec, journal, work, progress), unfinished)


def train_dictionary(
    sources: Iterable[Path | str],
    out: Path | str,
    *,
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    options: DictionarySetOptions | DictionaryOptions = DictionarySetOptions(),
    held_out: Iterable[Path | str] = (),
    work: Executor | None = None,
    progress: Progress | None = None,
) -> DictionarySet:
    """Describe the frames of the sources, fit dictionaries to them (`DictionarySet.fit`) and write these to `out`.

    `spec`, `matrix`, `work`: see `describe_sources`, which tells of memory and of killed runs, too. `options`: those of
    one map are of a set of one. `held_out`: sources that train nothing; how well the maps represent them
    (`Dictionary.quality_of`) is noted. `progress` is called with frames described and in all. Raises as
    `describe_sources` and `DictionarySet.fit` do.
    """
    with whole_file(Path(out)) as unfinished, open_journal(Path(out)) as journal:
        training, others = (find_sequences(some, options=source_options) for some in (sources, held_out))
        _check_unread(Path(out), [*training, *others], matrix)
        seen, unseen = (sum(len(sequence.frames) for sequence in some) for some in (training, others))
        tell = progress or (lambda done, total: None)
        values: Source
        if matrix is not None:
            found = describe(training, spec, matrix=matrix)
            spec, values, places = found.spec, found.values, found.table.places
        else:
            spec = spec or DescriptorSpec()
            kept = keep_described(training, spec, journal, work, lambda done, _: tell(done, seen + unseen))
            values, places = kept.values.pieces, kept.table.places
        chosen = DictionarySetOptions.of(options)
        made = DictionarySet.fit(values, spec=spec, places=places, options=chosen, work=work)
        names = tuple(sequence.name for sequence in training)
        made = DictionarySet(tuple(replace(one, sequences=names) for one in made.dictionaries))
        made.save(unfinished)
        _report(made)
        if others:
            more = describe(
                others, spec, matrix=matrix, work=work, progress=lambda done, _: tell(seen + done, seen + unseen)
            )
            _report_held_out(made.names, made.quality_of(more))
    return made


def _check_unread(out: Path, sequences: Iterable[Sequence], matrix: Path | str | None) -> None:
    """OutputError if the output would take the place of a recording, an image or a matrix that is read."""
    if not out.exists():
        return
    read = chain([Path(matrix)] if matrix is not None else [], *map(files_of, sequences))
    if any(path.exists() and path.samefile(out) for path in read):
        raise OutputError(f"{out}: is read, and would be written over; name another output")


def _report(made: DictionarySet) -> None:
    first, *others = made.dictionaries
    quality = first.quality
    log.info(
        "%d words, %d of them never seen, from %d of %d frames; %d components keep %.1f %% of the variance (%d would "
        "keep 99 %%); after %d epochs %s",
        len(first.hits),
        first.dead,
        quality.used,
        quality.frames,
        len(first.pca.components),
        100 * quality.explained,
        quality.needed,
        quality.epochs,
        _errors(quality),
    )
    for one in others:
        words = f"{len(one.hits)} words, {one.dead} of them never seen"
        log.info("%s: %s; after %d epochs %s", one.name, words, one.quality.epochs, _errors(one.quality))


def _report_held_out(names: Iterable[str], qualities: Iterable[MapQuality]) -> None:
    for name, quality in zip(names, qualities, strict=True):
        log.info(
            "held out%s: %d frames, %.1f %% of them on words that training never saw; %s",
            f", {name}" if name else "",
            quality.frames,
            100 * quality.unseen,
            _errors(quality),
        )


def _errors(quality: Quality | MapQuality) -> str:
    return (
        f"quantisation error {quality.quantisation_error:.4g}, topographic error {quality.topographic_error:.3f}, "
        f"entropy {quality.entropy:.2f} bits"
    )
