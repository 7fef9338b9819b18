"""The whole experiment: images or token streams in, a folder of results out."""

import glob
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from operator import attrgetter
from pathlib import Path
from typing import Any

from placerec.errors import ExperimentError
from placerec.experiments.grid.cells import KEPT, CellJob, GridCell, GridJob, run_cells
from placerec.experiments.grid.config import Config, read_config
from placerec.experiments.grid.learned import SPEC as LEARNED_SPEC, learn_folds
from placerec.experiments.grid.relit import RelitJob, relight_kept
from placerec.experiments.grid.report import write_reports
from placerec.experiments.grid.results import COLUMNS, Results, Row, SequenceCount, write_learned, write_results
from placerec.experiments.grid.splits import LIGHT, SPLITS, Fold, in_simulated_light, leave_one_out, named_tests
from placerec.experiments.store import Described, WordsJob, describe_all, held_output, key_of, make_tokens
from placerec.figures.canvas import check_figure
from placerec.files import content_digest_of_file
from placerec.frames import Sequence as FrameSequence, find_sequences
from placerec.frames.folder import natural_key
from placerec.frames.recordings import is_recording
from placerec.jobs import ProgressBar, map_jobs, silent, workers
from placerec.vision import DescriptorSpec, DictionaryOptions
from placerec.words.folder import VOCABULARY, stream_files
from placerec.words.stream import stream_name

SPEC = DescriptorSpec()
log = logging.getLogger(__name__)


def experiment(config: Path | str, out: Path | str, *, jobs: int = 1, progress: ProgressBar = silent) -> Results:
    """`placerec experiment`: run the grid of a TOML file (`read_config`) and write all that is known to `out`.

    The system of `placerec learn` is run beside the grid, unless the file asks for all `as_in_paper` or names token
    streams in place of images.

    What `out`/cache holds from runs before is used again; the results are the same for any number of `jobs`
    (processes). `progress(label)` is a context manager that gives a callback(done, total). Raises ExperimentError for
    a config that cannot be used, OutputError if another run is at work in `out`, and what the commands raise that it
    stands for.
    """
    out = Path(out)
    check_figure(out / "figure.png")
    plan = read_config(config)
    with held_output(out, out / "cache"):
        todo, results = run_grid(plan, out, jobs=jobs, progress=progress)
        learned = [] if plan.as_in_paper else learn_folds(todo, jobs=jobs, progress=progress)
        write_learned(learned, out)
        results = replace(results, learned=learned)
        write_reports(results, plan, Path(config), todo, out)
    return results


def run_grid(
    plan: Config, out: Path, *, jobs: int = 1, progress: ProgressBar = silent
) -> tuple[list[GridJob], Results]:
    """The jobs of a config and the rows of all their cells, which are written to `out`."""
    todo = list(_token_jobs(plan, out) if plan.tokens else _image_jobs(plan, out, jobs, progress))
    log.info("%d cells", sum(len(job.work.cells) for job in todo))
    with progress("recognise") as show:
        found = map_jobs(run_cells, [job.work for job in todo], jobs=jobs, progress=show)
    results = collect(todo, found)
    write_results(results, out)
    return todo, results


def _image_jobs(plan: Config, out: Path, jobs: int, progress: ProgressBar) -> Iterator[GridJob]:
    sequences = find_images(plan.sequences, plan.folder)
    folds = _folds(plan, [sequence.name for sequence in sequences])
    # What `placerec learn` sees of a frame holds what the paper's cells do.
    wide = SPEC if plan.as_in_paper else LEARNED_SPEC
    of = {key: one.part(SPEC) for key, one in _describe(sequences, folds, wide, out / "cache", jobs, progress).items()}
    todo = {}
    for size, seed, fold in product(plan.size, range(plan.seeds), folds):
        train, test = tuple(of["", name] for name in fold.train), tuple(of[fold.light, name] for name in fold.test)
        options = DictionaryOptions(size=size, seed=seed, units=plan.units)
        todo[size, seed, fold.name] = WordsJob(train, test, options, out / "cache")
    missing = [job for job in todo.values() if not job.made]
    with progress("learn words") as show:
        map_jobs(make_tokens, missing, jobs=jobs, progress=show)
    for fold, size, seed in product(folds, plan.size, range(plan.seeds)):
        images = todo[size, seed, fold.name]
        yield from _jobs(plan, size, seed, fold, images.folder, out, images)


def _describe(
    sequences: Sequence[FrameSequence],
    folds: Sequence[Fold],
    spec: DescriptorSpec,
    cache: Path,
    jobs: int,
    progress: ProgressBar,
) -> dict[tuple[str, str], Described]:
    """The sequences by light and name, described: all of them as they are (""), and in the lights of the tests."""
    names = {one.name: one for one in sequences}
    relit = list(dict.fromkeys((fold.light, name) for fold in folds if fold.light for name in fold.test))
    with progress("relight") as show:
        todo = [RelitJob(names[name], light, cache) for light, name in relit]
        tests = map_jobs(relight_kept, todo, jobs=jobs, progress=show)
    with progress("describe") as show:
        # One at a time, for a sequence and its copies have one name.
        described = describe_all([*sequences, *tests], spec, cache, together=1, work=workers(jobs), progress=show)
    return dict(zip([*(("", name) for name in names), *relit], described, strict=True))


def _token_jobs(plan: Config, out: Path) -> Iterator[GridJob]:
    for size, seed in product(plan.size, range(plan.seeds)):
        folder = plan.tokens_folder(size, seed)
        names = [stream_name(path) for path in stream_files([folder])]
        for fold in _folds(plan, names):
            yield from _jobs(plan, size, seed, fold, folder, out)


def _folds(plan: Config, names: Sequence[str]) -> list[Fold]:
    if plan.test:
        folds = named_tests(names, plan.test)
    else:
        folds = leave_one_out(names) if plan.split == LIGHT else SPLITS[plan.split](names)
    return in_simulated_light(folds) if plan.split == LIGHT else folds


def _jobs(
    plan: Config, size: int, seed: int, fold: Fold, folder: Path, out: Path, images: WordsJob | None = None
) -> Iterator[GridJob]:
    files = {stream_name(path): path for path in stream_files([folder])}
    train, test = (tuple(files[name] for name in names) for names in (fold.train, fold.test))
    if not (folder / VOCABULARY).exists():
        raise ExperimentError(f"{folder / VOCABULARY}: no such file; put the vocabulary (all words, one a line) there")
    digest = partial(content_digest_of_file, error=ExperimentError)
    content = [[(path.name, digest(path)) for path in paths] for paths in (train, test)]
    vocabulary = digest(folder / VOCABULARY)
    cells = tuple(GridCell(*values) for values in product(plan.smoothing, plan.order, plan.transition))
    for select in plan.select:
        kept = out / "cache" / "cells" / f"{key_of('cells', content, vocabulary, select)}.json"
        yield GridJob(size, seed, fold, images, CellJob(train, test, select, cells, plan.stay, plan.per, kept))


def find_images(globs: Sequence[str], folder: Path) -> list[FrameSequence]:
    """The sequences in what `globs` name (folders, videos, bags), relative to `folder`; ExperimentError for none."""
    found: dict[str, None] = {}
    for pattern in globs:
        paths = sorted(glob.glob(str(folder / pattern)), key=natural_key)
        usable = [path for path in paths if Path(path).is_dir() or is_recording(Path(path))]
        if not usable:
            remedy = "name folders of images, videos or bags"
            raise ExperimentError(f"[data] sequences: {folder / pattern} is no folder; {remedy}")
        found |= dict.fromkeys(usable)
    return find_sequences(found)


def collect(jobs: Sequence[GridJob], found: Sequence[Mapping[str, Any]]) -> Results:
    """The rows of all cells, sorted, and what the folds hold."""
    rows: list[Row] = []
    folds = {}
    for job, results in zip(jobs, found, strict=True):
        folds[job.fold.name] = {split: results["data"][split] for split in ("train", "test")}
        rows += [_row(job, cell, results) for cell in job.work.cells]
    return Results(sorted(rows, key=attrgetter(*COLUMNS[:7])), folds)


def _row(job: GridJob, cell: GridCell, results: Mapping[str, Any]) -> Row:
    found, frame_wise = results[job.work.name(cell)], results[f"frame-wise {cell.smoothing}"]
    return Row(
        size=job.size,
        seed=job.seed,
        fold=job.fold.name,
        select=job.work.select,
        same_word_run=results["data"]["same_word_run"],
        sequences={
            name: SequenceCount(frames, right, frame_wise[name], found["majority"][name], late)
            for name, (frames, right, late) in found["sequences"].items()
        },
        **cell._asdict(),
        **{name: found[name] for name in KEPT},
    )
