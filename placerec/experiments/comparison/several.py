"""`hohmm` as `placerec learn` makes it: several dictionaries, and how much their words weigh."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from placerec.arrays import Singles
from placerec.experiments.store import WordsJob, key_of
from placerec.files import whole_folder
from placerec.frames.table import FrameTable
from placerec.model import ModelOptions, PlaceModels, load_model
from placerec.model.folder import ModelFolder, owned_by
from placerec.model.learn import learn_folder
from placerec.vision import DictionarySet, DictionarySetOptions
from placerec.words import WordStream
from placerec.words.tokenize import tokens_of

# Frames that the cost of the words is measured on.
TIMED = 300


@dataclass(frozen=True)
class SeveralDictionaries:
    """Models of several dictionaries, and the test sequences in their words; `microseconds`: a frame's, for all words.

    The time is that from a frame's descriptor to the frame's words, one frame after the other.
    """

    models: PlaceModels
    tests: tuple[WordStream, ...] = field(repr=False)
    microseconds: float


def learn_several(job: WordsJob, seed: int) -> SeveralDictionaries:
    """Learn from the training sequences of a job as `placerec learn` does, or take what an earlier run left."""
    training, options = [one.load() for one in job.train], DictionarySetOptions(seed=seed)
    labels = [(one.sequence.name, [*found.table.places]) for one, found in zip(job.train, training, strict=True)]
    path = job.cache / "models" / key_of("learned", [one.kept.stem for one in job.train], labels, repr(options))
    if not path.exists():
        values = np.concatenate([found.values for found in training])
        table = FrameTable.concat(found.table for found in training)
        with whole_folder(path, owned_by(path)) as folder:
            learn_folder(ModelFolder(folder), values, table, training[0].spec, options, ModelOptions())
    models = load_model(path)
    dictionaries = DictionarySet.load(models.folder.words)
    tests = [one.load() for one in job.test]
    rows = np.concatenate([found.values for found in tests])[:TIMED]
    streams = tuple(stream for found in tests for stream in tokens_of(found, dictionaries))
    return SeveralDictionaries(models, streams, 1e6 * _seconds(dictionaries, [row[None] for row in rows]))


def _seconds(dictionaries: DictionarySet, rows: Sequence[Singles]) -> float:
    """How long a descriptor takes to become words, the mean over some of them."""
    dictionaries.words(rows[0])
    started = perf_counter()
    for row in rows:
        dictionaries.words(row)
    return (perf_counter() - started) / len(rows)
