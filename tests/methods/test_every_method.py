"""What holds for every system: beliefs are beliefs, and neither the names of places and words nor haste matter."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_tokens
from helpers.training_sets import followed, training_set_of, training_sets
from hypothesis import given, settings, strategies as st

from placerec.arrays import Ints
from placerec.cli.models import METHODS as NAMED
from placerec.methods import METHODS, MakeStepper, TrainingSet, decode, load_decoder, make_training_set
from placerec.model import ModelOptions, train_lm
from placerec.words import Selection, read_stream

FITS = {name: method.fit for name, method in METHODS.items() if method.fit}
every_stepper = pytest.mark.parametrize("fit", FITS.values(), ids=FITS)


def test_the_command_line_names_them_all() -> None:
    assert ("hohmm", *NAMED) == tuple(METHODS)


@every_stepper
@given(training=training_sets(), data=st.data())
@settings(max_examples=40)
def test_beliefs_are_beliefs(
    fit: Callable[[TrainingSet], MakeStepper], training: TrainingSet, data: st.DataObject
) -> None:
    V = len(training.vocabulary)
    words = data.draw(st.lists(st.integers(0, V - 1), min_size=1, max_size=40))
    elapsed = [0, *data.draw(st.lists(st.integers(1, 9), min_size=len(words) - 1, max_size=len(words) - 1))]
    make_stepper = fit(training)
    found = followed(make_stepper, words, elapsed)
    assert found.shape == (len(words), len(training.places))
    assert (found >= 0).all()
    np.testing.assert_allclose(found.sum(axis=1), 1, rtol=1e-12)
    # A new sequence knows nothing of the one before, and two at once nothing of each other.
    first, second = make_stepper(), make_stepper()
    for word, frames, belief in zip(words, elapsed, found, strict=True):
        np.testing.assert_array_equal(first(word, frames), belief)
        second(V - 1 - word, frames)


def renamed(training: TrainingSet, places: Ints, words: Ints) -> TrainingSet:
    """The same with other numbers: place places[c] becomes c, word w becomes words[w]."""
    assert training.steps is not None
    assert training.triples is not None
    old = np.argsort(words)
    vocabulary = [training.vocabulary[w] for w in old]
    text = {
        training.places[c]: [[training.vocabulary[w] for w in visit] for visit in training.sentences[c]] for c in places
    }
    return make_training_set(
        text,
        vocabulary,
        steps=training.steps[np.ix_(places, places)],
        triples=training.triples[np.ix_(places, places, places)],
        models={place: training.models[place] for place in text},
    )


@every_stepper
def test_names_do_not_matter(fit: Callable[[TrainingSet], MakeStepper]) -> None:
    rng = np.random.default_rng(1)
    C, V = 4, 7
    likely = rng.dirichlet(np.full(V, 0.6), C)
    sentences = [[rng.choice(V, 20 + 3 * c, p=likely[c]).tolist() for _ in range(3)] for c in range(C)]
    training = training_set_of(sentences, V, steps=rng.integers(1, 50, (C, C)), triples=rng.integers(0, 4, (C, C, C)))
    test = np.concatenate([rng.choice(V, 15, p=likely[c]) for c in (0, 2, 1, 3, 0)])
    expected = followed(fit(training), test.tolist())
    places, words = rng.permutation(C), rng.permutation(V)
    found = followed(fit(renamed(training, places, words)), words[test].tolist())
    np.testing.assert_allclose(found, expected[:, places], rtol=1e-9, atol=1e-12)


@every_stepper
def test_one_place_is_certain(fit: Callable[[TrainingSet], MakeStepper]) -> None:
    one = np.ones((1, 1), np.int64)
    training = training_set_of([[[0, 1]]], 3, steps=one, triples=np.zeros((1, 1, 1), np.int64))
    np.testing.assert_allclose(followed(fit(training), [0, 2, 1]), 1, rtol=1e-12)
    np.testing.assert_allclose(followed(fit(replace(training, sentences=((),))), [0, 2, 1]), 1, rtol=1e-12)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    tokens = write_tokens(root / "tokens")
    for select in ("none", "unique"):
        options = ModelOptions(select=Selection(select))
        train_lm([tokens / "run1.tsv", tokens / "run2.tsv"], root / select, options=options, as_in_paper=True)
    return root


@pytest.mark.parametrize("select", ["none", "unique"])
@pytest.mark.parametrize("name", METHODS)
def test_a_robot_gets_what_a_recording_gets(name: str, select: str, world: Path) -> None:
    """A word after the other, words that nobody knows among them, after another sequence."""
    path = world / "tokens/run3.tsv"
    stream = read_stream(path)
    strange = replace(stream, words=("zz", *stream.words[1:30], "zz", *stream.words[31:]))
    decoder = load_decoder(name, world / select)
    expected = decoder.decode(strange)
    for word in stream.words:
        decoder.update(word)
    again = load_decoder(name, world / select)
    assert "zz" not in again
    answers = [again.update(word) if word in again else again.skip() for word in strange.words]
    np.testing.assert_allclose([answer.probability for answer in answers], expected.belief, rtol=1e-9, atol=1e-12)
    assert [answer.selected for answer in answers] == expected.selected.tolist()
    assert [answer.best for answer in answers] == list(expected.best)
    [plain] = decode([path], world / select, method=name)
    assert plain.truth == stream.places


@pytest.mark.parametrize("name", [name for name in METHODS if name != "majority"])
def test_every_method_beats_the_majority(name: str, world: Path) -> None:
    [found] = decode([world / "tokens/run3.tsv"], world / "none", method=name)
    right = np.mean([best == place for best, place in zip(found.best, found.truth, strict=True)])
    assert right > 0.4  # A third of the frames are in each place.
