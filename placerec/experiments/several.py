"""`hohmm` as `placerec learn` makes it: several dictionaries, and how much their words weigh."""

from dataclasses import dataclass, field

import numpy as np

from placerec.experiments.store import WordsJob, key_of
from placerec.files import whole_folder
from placerec.frames.table import FrameTable
from placerec.model import ModelOptions, PlaceModels, load_model
from placerec.model.folder import ModelFolder, owned_by
from placerec.model.learn import learn_folder, learn_models
from placerec.vision import DictionarySet, DictionarySetOptions
from placerec.words import WordStream
from placerec.words.tokenize import tokens_of


@dataclass(frozen=True)
class SeveralDictionaries:
    """Several dictionaries and models of their words, and the test sequences in these words."""

    dictionaries: DictionarySet
    models: PlaceModels
    tests: tuple[WordStream, ...] = field(repr=False)


def learn_several(job: WordsJob, seed: int, given: DictionarySet | None = None) -> SeveralDictionaries:
    """Learn from the training sequences of a job as `placerec learn` does, or take what an earlier run left.

    `given`: dictionaries to use as they are, whose words are weighed as `train-lm` weighs those of token streams.
    """
    training, options = [one.load() for one in job.train], DictionarySetOptions(seed=seed)
    labels = [(one.sequence.name, [*found.table.places]) for one, found in zip(job.train, training, strict=True)]
    words = repr(options) if given is None else given.fingerprint
    path = job.cache / "models" / key_of("learned, views chosen", [one.key for one in job.train], labels, words)
    if not path.exists():
        values = np.concatenate([found.values for found in training])
        table = FrameTable.concat(found.table for found in training)
        with whole_folder(path, owned_by(path)) as folder:
            if given is None:
                learn_folder(ModelFolder(folder), values, table, training[0].spec, options, ModelOptions())
            else:
                learn_models(ModelFolder(folder), values, table, training[0].spec, given, ModelOptions())
    models = load_model(path)
    network = None if given is None or given.spec.network is None else given.spec.network.file
    dictionaries = DictionarySet.load(models.folder.words, network=network)
    tests = [one.load() for one in job.test]
    streams = tuple(stream for found in tests for stream in tokens_of(found, dictionaries))
    return SeveralDictionaries(dictionaries, models, streams)
