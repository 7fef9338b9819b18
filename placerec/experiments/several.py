"""`hohmm` as `placerec learn` makes it: several dictionaries, and how much their words weigh."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from placerec.experiments.store import WordsJob, key_of
from placerec.files import whole_folder
from placerec.frames.table import FrameTable
from placerec.model import ModelOptions, PlaceModels, load_model
from placerec.model.folder import ModelFolder, owned_by
from placerec.model.learn import learn_folder, learn_models
from placerec.vision import Descriptors, Dictionary, DictionarySet, DictionarySetOptions
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


def learn_several(job: WordsJob, seed: int, given: DictionarySet | None = None) -> SeveralDictionaries:
    """Learn from the training sequences of a job as `placerec learn` does, or take what an earlier run left.

    `given`: dictionaries to use as they are, whose words are weighed as `train-lm` weighs those of token streams.
    """
    training, options = [one.load() for one in job.train], DictionarySetOptions(seed=seed)
    labels = [(one.sequence.name, [*found.table.places]) for one, found in zip(job.train, training, strict=True)]
    words = repr(options) if given is None else given.fingerprint
    path = job.cache / "models" / key_of("learned", [one.kept.stem for one in job.train], labels, words)
    if not path.exists():
        values = np.concatenate([found.values for found in training])
        table = FrameTable.concat(found.table for found in training)
        with whole_folder(path, owned_by(path)) as folder:
            if given is None:
                learn_folder(ModelFolder(folder), values, table, training[0].spec, options, ModelOptions())
            else:
                learn_models(ModelFolder(folder), values, table, given, ModelOptions())
    models = load_model(path)
    dictionaries = DictionarySet.load(models.folder.words)
    tests = [one.load() for one in job.test]
    streams = tuple(stream for found in tests for stream in tokens_of(found, dictionaries))
    return SeveralDictionaries(models, streams, microseconds_of_words(dictionaries, tests))


def microseconds_of_words(dictionaries: Dictionary | DictionarySet, described: Sequence[Descriptors]) -> float:
    """How long a descriptor takes to become words, one after the other, the mean over the first TIMED."""
    rows = [row[None] for row in np.concatenate([one.values for one in described])[:TIMED]]
    dictionaries.words(rows[0])
    started = perf_counter()
    for row in rows:
        dictionaries.words(row)
    return 1e6 * (perf_counter() - started) / len(rows)
