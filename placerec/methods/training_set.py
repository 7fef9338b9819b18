"""What a system may learn from: the sentences of each place, and what model.json says beside them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError
from placerec.lm import BackoffModel
from placerec.model.folder import PlaceModels
from placerec.words import Sentences, read_vocabulary

# The word's index in the vocabulary, and the frames since the selected word before (0 for the first), to a belief (C,).
StepFunction = Callable[[int, int], Floats]
# What starts a sequence.
MakeStepper = Callable[[], StepFunction]


@dataclass(frozen=True)
class TrainingSet:
    """C places, V words; `sentences`: per place its visits, each the indices of its selected words, int64 (length,).

    `prior` float64 (C,): how probable each place is before anything is seen. `delta`: what is added to every count.
    `steps` int64 (C, C): how often a frame at one place was followed by one at the other; `triples` int64 (C, C, C):
    how often a visit to one place (second index) came from another (first) and led to another (third). Both are None
    where sentences were learned. `models`: the n-gram models of the places; empty where there are none.
    """

    places: tuple[str, ...]
    vocabulary: tuple[str, ...] = field(repr=False)
    sentences: tuple[tuple[Ints, ...], ...] = field(repr=False)
    prior: Floats
    delta: float = 1.0
    steps: Ints | None = field(default=None, repr=False)
    triples: Ints | None = field(default=None, repr=False)
    models: Mapping[str, BackoffModel] = field(default_factory=dict, repr=False)

    @property
    def counts(self) -> Floats:
        """How often each word was selected in each place, (C, V)."""
        V = len(self.vocabulary)
        words = [np.concatenate([np.zeros(0, np.int64), *visits]) for visits in self.sentences]
        return np.array([np.bincount(ids, minlength=V) for ids in words], np.float64)


def make_training_set(
    sentences: Mapping[str, Sentences],
    vocabulary: Sequence[str],
    *,
    delta: float = 1.0,
    steps: Ints | None = None,
    triples: Ints | None = None,
    models: Mapping[str, BackoffModel] | None = None,
) -> TrainingSet:
    """The training set of sentences per place; the prior follows their numbers of words, with 1/C added for each place.

    Raises ModelError for a word that the vocabulary lacks.
    """
    index = {word: i for i, word in enumerate(vocabulary)}
    try:
        numbered = tuple(
            tuple(np.array([index[word] for word in visit], np.int64) for visit in visits)
            for visits in sentences.values()
        )
    except KeyError as error:
        raise ModelError(f"the word {error} of the sentences is not in the vocabulary; train the model again") from None
    words = np.array([sum(map(len, visits)) for visits in numbered], np.float64)
    prior = (words + 1 / len(words)) / (words.sum() + 1)
    return TrainingSet(tuple(sentences), tuple(vocabulary), numbered, prior, delta, steps, triples, models or {})


def read_training_set(model: PlaceModels) -> TrainingSet:
    """The training set in a MODEL/ folder; `delta` is the model's own if its smoothing adds one, and 1 otherwise.

    Raises ModelError or StreamError, naming the file, for anything missing or broken.
    """
    record = model.description.record
    return make_training_set(
        model.folder.sentences(record.places),
        read_vocabulary(model.folder.vocabulary),
        delta=model.description.added_count,
        steps=record.transitions,
        triples=record.triples,
        models=model.models,
    )


def log_word_p(training: TrainingSet) -> Floats:
    """log P(word | place), natural, float64 (C, V): (c + delta) / (N + delta V), 1/V where nothing was seen."""
    counts = training.counts + training.delta
    log_p: Floats = np.log(counts / counts.sum(axis=1, keepdims=True))
    return log_p


def lead(scores: Floats) -> float:
    """How far the best score is above the second; infinite if there is no other."""
    if len(scores) == 1:
        return np.inf
    second, best = np.partition(scores, -2)[-2:]
    return float(best - second)
