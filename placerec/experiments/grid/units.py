"""The units of work of an experiment: the cells of one size, seed and fold with one selection."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from placerec.errors import ExperimentError
from placerec.experiments.grid import cache
from placerec.experiments.grid.cells import Cell, CellJob
from placerec.experiments.grid.config import Config
from placerec.experiments.grid.splits import SPLITS, Fold, named_tests
from placerec.experiments.grid.tokens import TokensJob, describe_all, find_images, make_tokens
from placerec.jobs import map_jobs, workers
from placerec.model.corpus import VOCABULARY, stream_files

ProgressBar = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]


@dataclass(frozen=True)
class Unit:
    """What a `CellJob` is of; `images`: what made its token streams, None where they were given."""

    size: int
    seed: int
    fold: Fold
    images: TokensJob | None
    job: CellJob


def find_units(plan: Config, out: Path, *, jobs: int, progress: ProgressBar) -> list[Unit]:
    """All units of a config; token streams are made of images, as far as `out`/cache does not hold them."""
    return list(_token_units(plan, out) if plan.tokens else _image_units(plan, out, jobs, progress))


def _image_units(plan: Config, out: Path, jobs: int, progress: ProgressBar) -> Iterator[Unit]:
    sequences = find_images(plan.sequences, plan.folder)
    folds = _folds(plan, [sequence.name for sequence in sequences])
    with progress("describe") as show:
        described = describe_all(sequences, out / "cache" / "descriptors", work=workers(jobs), progress=show)
    of = {one.sequence.name: one for one in described}
    todo = {}
    for size, seed, fold in product(plan.size, range(plan.seeds), folds):
        train, test = (tuple(of[name] for name in names) for names in (fold.train, fold.test))
        todo[size, seed, fold.name] = TokensJob(train, test, size, seed, plan.units, out / "cache")
    missing = [job for job in todo.values() if not job.made]
    with progress("learn words") as show:
        map_jobs(make_tokens, missing, jobs=jobs, progress=show)
    for fold in folds:
        for size, seed in product(plan.size, range(plan.seeds)):
            images = todo[size, seed, fold.name]
            yield from _units(plan, size, seed, fold, images.folder, out, images)


def _token_units(plan: Config, out: Path) -> Iterator[Unit]:
    for size, seed in product(plan.size, range(plan.seeds)):
        folder = plan.tokens_folder(size, seed)
        names = [_stem(path) for path in stream_files([folder])]
        for fold in _folds(plan, names):
            yield from _units(plan, size, seed, fold, folder, out)


def _folds(plan: Config, names: Sequence[str]) -> list[Fold]:
    return SPLITS[plan.split](names) if plan.split else named_tests(names, plan.test)


def _stem(path: Path) -> str:
    return path.name.removesuffix(".gz").removesuffix(".tsv")


def _units(
    plan: Config, size: int, seed: int, fold: Fold, folder: Path, out: Path, images: TokensJob | None = None
) -> Iterator[Unit]:
    files = {_stem(path): path for path in stream_files([folder])}
    train, test = (tuple(files[name] for name in names) for names in (fold.train, fold.test))
    if not (folder / VOCABULARY).exists():
        raise ExperimentError(f"{folder / VOCABULARY}: no such file; put the vocabulary (all words, one a line) there")
    content = [[(path.name, cache.content_of(path)) for path in paths] for paths in (train, test)]
    vocabulary = cache.content_of(folder / VOCABULARY)
    cells = tuple(Cell(*values) for values in product(plan.smoothing, plan.order, plan.transition))
    for select in plan.select:
        kept = out / "cache" / "cells" / f"{cache.key_of('cells', content, vocabulary, select)}.json"
        yield Unit(size, seed, fold, images, CellJob(train, test, select, cells, plan.stay, plan.per, kept))
