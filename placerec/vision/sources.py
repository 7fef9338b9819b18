"""The whole way from image sources to a file: what `placerec describe` and `placerec train-words` do."""

import logging
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from placerec.errors import OutputError, SourceError, counted
from placerec.files import whole_file
from placerec.frames import Sequence, SourceOptions, files_of, find_sequences
from placerec.jobs import Executor, Progress
from placerec.journal import Journal, open_journal
from placerec.vision.describe import Descriptors, KeptDescriptors, describe, keep_described, save_descriptors
from placerec.vision.dictionary_set import DictionarySet
from placerec.vision.learning import Quality
from placerec.vision.options import DictionaryOptions, DictionarySetOptions
from placerec.vision.som import MapQuality
from placerec.vision.spec import DescriptorSpec
from placerec.vision.stored import are_stored, read_descriptors

log = logging.getLogger(__name__)


def describe_sources(
    sources: Iterable[Path | str],
    out: Path | str,
    *,
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    work: Executor | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the descriptors of all frames of the sources to `out`; `progress` is called with frames done and in all.

    `spec`, `matrix`, `work`, `cache`: as for `describe`. The descriptors are kept in a file beside `out` while the
    work goes on, not in memory; after a run that was killed or interrupted the next one goes on from there. Raises
    SourceError for sources and VisionError for images or a matrix that cannot be used, OutputError for the file.
    """
    # The file comes first: that it cannot be written must not be found out after an hour of images.
    with whole_file(Path(out)) as unfinished, open_journal(Path(out)) as journal:
        sequences = find_sequences(sources, options=source_options)
        _check_unread(Path(out), sequences, matrix)
        save_descriptors(_described(sequences, spec, matrix, work, cache, progress, journal), unfinished)


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
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> DictionarySet:
    """Describe the frames of the sources, fit dictionaries to them (`DictionarySet.fit`) and write these to `out`.

    The sources may be files of `placerec describe` (.npz), all of them, in place of images. `spec`, `matrix`, `work`,
    `cache`: see `describe_sources`, which tells of memory and of killed runs, too. `options`: those of one map are of a
    set of one. `held_out`: sources that train nothing; how well the maps represent them (`Dictionary.quality_of`) is
    noted. `progress` is called with frames described and in all. Raises as `describe_sources`, `read_descriptors` and
    `DictionarySet.fit` do.
    """
    with whole_file(Path(out)) as unfinished, open_journal(Path(out)) as journal:
        training, others = (open_sources(some, source_options, spec, matrix) for some in (sources, held_out))
        _check_unread(Path(out), [one for some in (training, others) if isinstance(some, list) for one in some], matrix)
        seen, unseen = (
            sum(len(one.frames) for one in some) if isinstance(some, list) else 0 for some in (training, others)
        )
        options = DictionarySetOptions.of(options)
        if isinstance(training, list) and matrix is None:
            spec = spec or DescriptorSpec(kind=options.kind())
        tell = progress or (lambda done, total: None)
        shown = partial(_described, matrix=matrix, work=work, cache=cache)
        found = shown(training, spec, progress=lambda done, _: tell(done, seen + unseen), journal=journal)
        made = DictionarySet.fit(
            found.values if isinstance(found, Descriptors) else found.values.pieces,
            spec=found.spec,
            places=found.table.places,
            options=options,
            work=work,
        )
        names = tuple(found.table.by_sequence())
        made = DictionarySet(tuple(replace(one, sequences=names) for one in made.dictionaries))
        made.save(unfinished)
        _report(made)
        if others:
            more = shown(others, found.spec, progress=lambda done, _: tell(seen + done, seen + unseen))
            if isinstance(more, KeptDescriptors):
                more = Descriptors(more.spec, np.concatenate([*more.values.pieces()]), more.table)
            _report_held_out(made.names, made.quality_of(more))
    return made


def open_sources(
    sources: Iterable[Path | str],
    options: SourceOptions,
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    *,
    endless: bool = False,
) -> list[Sequence] | KeptDescriptors:
    """The sequences of image sources, or the descriptors in the files of `placerec describe` that sources are.

    `spec`: of these descriptors. `options`, `endless`: see `find_sequences`. Raises what that and `read_descriptors`
    raise, and SourceError for descriptors in both sources and `matrix`.
    """
    sources = [sources] if isinstance(sources, str | Path) else list(sources)
    if not are_stored(sources, options):
        return find_sequences(sources, options=options, endless=endless)
    if matrix is not None:
        raise SourceError(f"{sources[0]}: holds descriptors, and so does {matrix}; name one of them")
    return read_descriptors(sources, spec)


def _described(
    opened: list[Sequence] | KeptDescriptors,
    spec: DescriptorSpec | None,
    matrix: Path | str | None,
    work: Executor | None,
    cache: Path | str | None,
    progress: Progress | None,
    journal: Journal | None = None,
) -> Descriptors | KeptDescriptors:
    """The descriptors of opened sources; where images are described they are left in the journal, if there is one."""
    if isinstance(opened, KeptDescriptors):
        return opened
    if matrix is not None or journal is None:
        return describe(opened, spec, matrix=matrix, work=work, cache=cache, progress=progress)
    return keep_described(opened, spec or DescriptorSpec(), journal, work, cache, progress)


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
    of_frames = counted(quality.frames, "frame")
    if quality.used < quality.frames:
        of_frames = f"{quality.used} of {of_frames}"
    log.info(
        "%d words, %d of them never seen, from %s; %d components keep %.1f %% of the variance (%d would "
        "keep 99 %%); after %d epochs %s",
        len(first.hits),
        first.dead,
        of_frames,
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
            "held out%s: %s, %.1f %% of them on words that training never saw; %s",
            f", {name}" if name else "",
            counted(quality.frames, "frame"),
            100 * quality.unseen,
            _errors(quality),
        )


def _errors(quality: Quality | MapQuality) -> str:
    return (
        f"quantisation error {quality.quantisation_error:.4g}, topographic error {quality.topographic_error:.3f}, "
        f"entropy {quality.entropy:.2f} bits"
    )
