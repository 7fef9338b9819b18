"""Training sets for property tests, and what a followed sequence believes."""

from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st

from placerec.arrays import Floats, Ints
from placerec.lm import count_ngrams
from placerec.methods import MakeStepper, TrainingSet, make_training_set
from placerec.model import ModelOptions, estimate_place


def training_set_of(
    sentences: Sequence[Sequence[Sequence[int]]],
    words: int,
    *,
    order: int = 2,
    steps: Ints | None = None,
    triples: Ints | None = None,
) -> TrainingSet:
    """Places p0, p1... of sentences of word numbers, words w0, w1..., with models of that order."""
    text = {f"p{c}": [[f"w{w}" for w in visit] for visit in visits] for c, visits in enumerate(sentences)}
    vocabulary = [f"w{w}" for w in range(words)]
    models = {
        place: estimate_place(count_ngrams(visits, order, vocabulary=vocabulary), ModelOptions(order))
        for place, visits in text.items()
    }
    return make_training_set(text, vocabulary, steps=steps, triples=triples, models=models)


def followed(follow: MakeStepper, words: Sequence[int], elapsed: Sequence[int] | None = None) -> Floats:
    """The beliefs (T, C) after each word; 1 frame between words by default."""
    step = follow()
    frames = [min(i, 1) for i in range(len(words))] if elapsed is None else elapsed
    return np.array([step(word, frame).copy() for word, frame in zip(words, frames, strict=True)])


@st.composite
def training_sets(draw: st.DrawFn, places: int = 4, words: int = 5) -> TrainingSet:
    """One place or more, some of them empty; steps and triples that need not fit each other."""
    C, V = draw(st.integers(1, places)), draw(st.integers(1, words))
    visit = st.lists(st.integers(0, V - 1), min_size=1, max_size=8)
    sentences = draw(st.lists(st.lists(visit, max_size=3), min_size=C, max_size=C))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    triples = rng.integers(0, 4, (C, C, C))
    for c in range(C):
        triples[c, c, :] = triples[:, c, c] = 0
    return training_set_of(sentences, V, steps=rng.integers(0, 20, (C, C)), triples=triples)
