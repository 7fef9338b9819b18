"""The system of `placerec learn` on the folds of a grid: a line to compare the paper's cells with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from placerec.experiments.grid.cells import GridJob, judged
from placerec.experiments.grid.results import LearnedRow
from placerec.experiments.several import learn_several
from placerec.experiments.store import WordsJob, key_of, load, save
from placerec.jobs import ProgressBar, map_jobs
from placerec.methods import HOHMM, make_decoder
from placerec.vision import DEFAULT_KIND, DescriptorSpec, DictionarySetOptions

SPEC = DescriptorSpec(kind=DEFAULT_KIND)


@dataclass(frozen=True)
class LearnedJob:
    """What is learned with a seed from the training sequences of a fold, and judged on the fold's tests.

    `images`: both kinds of sequences, described; the map of the job is not used.
    """

    seed: int
    fold: str
    images: WordsJob

    @property
    def kept(self) -> Path:
        """The file where the result is kept."""
        options = repr(DictionarySetOptions(seed=self.seed))
        key = key_of("learned", len(self.images.train), self.images.labels, options)
        return self.images.cache / "learned" / f"{key}.json"


def learn_folds(grid: Sequence[GridJob], *, jobs: int, progress: ProgressBar) -> list[LearnedRow]:
    """The rows of every seed and fold of a grid whose words were learned from images; of token streams none.

    A result that is kept is not computed again. `jobs`: processes.
    """
    # The cells have the paper's descriptors, a part of these.
    todo = {
        (job.seed, job.fold.name): LearnedJob(job.seed, job.fold.name, job.images.part(SPEC))
        for job in grid
        if job.images
    }
    if not todo:
        return []
    with progress("learn and recognise") as show:
        found = map_jobs(run_learned, [*todo.values()], jobs=jobs, progress=show)
    return sorted((_row(job, one) for job, one in zip(todo.values(), found, strict=True)), key=lambda row: row[:2])


def run_learned(job: LearnedJob) -> dict[str, Any]:
    """The result of a job in plain values: `cells.judged` beliefs, `alpha` and `memory`."""
    results = load(job.kept)
    if not results:
        several = learn_several(job.images, job.seed)
        decoder = make_decoder(HOHMM, several.models)
        results = judged([decoder.decode(stream) for stream in several.tests])
        evidence = several.models.description.evidence
        if evidence is not None:
            results |= {"alpha": evidence.weights.alpha, "memory": evidence.weights.memory}
        save(job.kept, results)
    return results


def _row(job: LearnedJob, found: Mapping[str, Any]) -> LearnedRow:
    counts = found["sequences"].values()
    measured = {name: found[name] for name in LearnedRow._fields if name in found}
    return LearnedRow(seed=job.seed, fold=job.fold, right=sum(right for _, right, _ in counts), **measured)
