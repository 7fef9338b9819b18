"""The work of an experiment: the cells of one size, seed and fold with one selection, and the tokens they need."""

import glob
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from placerec.errors import ExperimentError
from placerec.experiments.grid.cells import CellJob, GridCell
from placerec.experiments.grid.config import Config
from placerec.experiments.grid.splits import SPLITS, Fold, named_tests
from placerec.experiments.store import WordsJob, describe_all, key_of, make_tokens
from placerec.files import content_digest_of_file
from placerec.frames import Sequence as FrameSequence
from placerec.frames import find_sequences
from placerec.frames.folder import natural_key
from placerec.frames.recordings import is_recording
from placerec.jobs import ProgressBar, map_jobs, workers
from placerec.vision import DescriptorSpec
from placerec.words.folder import VOCABULARY, stream_files

SPEC = DescriptorSpec()


@dataclass(frozen=True)
class GridJob:
    """What a `CellJob` is of; `images`: what made its token streams, None where they were given."""

    size: int
    seed: int
    fold: Fold
    images: WordsJob | None
    work: CellJob


def find_jobs(plan: Config, out: Path, *, jobs: int, progress: ProgressBar) -> list[GridJob]:
    """All jobs of a config; token streams are made of images, as far as `out`/cache does not hold them."""
    return list(_token_jobs(plan, out) if plan.tokens else _image_jobs(plan, out, jobs, progress))


def _image_jobs(plan: Config, out: Path, jobs: int, progress: ProgressBar) -> Iterator[GridJob]:
    sequences = find_images(plan.sequences, plan.folder)
    folds = _folds(plan, [sequence.name for sequence in sequences])
    with progress("describe") as show:
        described = describe_all(sequences, SPEC, out / "cache", work=workers(jobs), progress=show)
    of = {one.sequence.name: one for one in described}
    todo = {}
    for size, seed, fold in product(plan.size, range(plan.seeds), folds):
        train, test = (tuple(of[name] for name in names) for names in (fold.train, fold.test))
        todo[size, seed, fold.name] = WordsJob(train, test, size, seed, plan.units, out / "cache")
    missing = [job for job in todo.values() if not job.made]
    with progress("learn words") as show:
        map_jobs(make_tokens, missing, jobs=jobs, progress=show)
    for fold in folds:
        for size, seed in product(plan.size, range(plan.seeds)):
            images = todo[size, seed, fold.name]
            yield from _jobs(plan, size, seed, fold, images.folder, out, images)


def _token_jobs(plan: Config, out: Path) -> Iterator[GridJob]:
    for size, seed in product(plan.size, range(plan.seeds)):
        folder = plan.tokens_folder(size, seed)
        names = [_stem(path) for path in stream_files([folder])]
        for fold in _folds(plan, names):
            yield from _jobs(plan, size, seed, fold, folder, out)


def _folds(plan: Config, names: Sequence[str]) -> list[Fold]:
    return SPLITS[plan.split](names) if plan.split else named_tests(names, plan.test)


def _stem(path: Path) -> str:
    return path.name.removesuffix(".gz").removesuffix(".tsv")


def _jobs(
    plan: Config, size: int, seed: int, fold: Fold, folder: Path, out: Path, images: WordsJob | None = None
) -> Iterator[GridJob]:
    files = {_stem(path): path for path in stream_files([folder])}
    train, test = (tuple(files[name] for name in names) for names in (fold.train, fold.test))
    if not (folder / VOCABULARY).exists():
        raise ExperimentError(f"{folder / VOCABULARY}: no such file; put the vocabulary (all words, one a line) there")
    content = [
        [(path.name, content_digest_of_file(path, ExperimentError)) for path in paths] for paths in (train, test)
    ]
    vocabulary = content_digest_of_file(folder / VOCABULARY, ExperimentError)
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
