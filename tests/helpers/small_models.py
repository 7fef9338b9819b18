"""Models of places over four words for property tests, and what else a recognizer is made with."""

import numpy as np
from hypothesis import strategies as st

from placerec.hohmm.unknown import DistanceModel, UnknownModel
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.words import Selection

WORDS = ["a", "b", "c", "d"]
corpora = st.lists(st.lists(st.lists(st.sampled_from(WORDS), max_size=6), max_size=4), min_size=1, max_size=4)
selections = st.sampled_from([Selection(), Selection("subsample", 3), Selection("compress", 2), Selection("unique")])


def models_of(corpus: list[list[list[str]]], order: int) -> dict[str, BackoffModel]:
    """place0, place1... of the sentences of each."""
    return {
        f"place{i}": estimate(
            count_ngrams(sentences, order, vocabulary=WORDS, markers=False),
            smoothing("witten-bell"),
            non_events=["</s>"],
        )
        for i, sentences in enumerate(corpus)
    }


def novelty(places: int) -> UnknownModel:
    """What a place that is none of so many is weighed with, by words and distances."""
    return UnknownModel(len(WORDS), 0.5, DistanceModel(np.linspace(0, 1, places), 0.3))
