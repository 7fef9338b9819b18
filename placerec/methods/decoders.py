"""Every system that learns from words alone, by name, and the decoder of a MODEL/ folder by each of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from placerec.arrays import Floats
from placerec.errors import ModelError
from placerec.hohmm.decoder import Posterior, SequenceDecoder, TakeIn
from placerec.hohmm.evidence import Emissions
from placerec.methods import (
    dubois2011,
    filliat2008,
    guillaume2011,
    mtd,
    naive_bayes,
    pronobis2010,
    ranganathan2010,
    second_order,
    wu2009,
)
from placerec.methods.training_set import MakeStepper, TrainingSet, read_training_set
from placerec.model import Decoding, PlaceModels, load_model, make_recognizer
from placerec.model.decoding import AS_LEARNED, PAPER, ScorerName, as_in_paper, check_online, check_scorer, check_words
from placerec.words import Selection
from placerec.words.stream import FIRST

if TYPE_CHECKING:
    from placerec.vision import Dictionary, DictionarySet


@dataclass(frozen=True)
class Method:
    """A system: either `emissions`, for the filter of eq. 1, or `fit`, beliefs without it; neither: `hohmm`.

    `fit_with_unknown`: `fit` with one column more, the probability that the place is none of the model's.
    """

    emissions: Callable[[TrainingSet], Emissions] | None = None
    fit: Callable[[TrainingSet], MakeStepper] | None = None
    fit_with_unknown: Callable[[TrainingSet], MakeStepper] | None = None


HOHMM = "hohmm"
METHODS: dict[str, Method] = {
    HOHMM: Method(),
    "majority": Method(fit=naive_bayes.fit_majority),
    "naive-bayes": Method(fit=naive_bayes.fit),
    "wu2009": Method(emissions=wu2009.fit),
    "dubois2011": Method(emissions=dubois2011.fit),
    "guillaume2011": Method(fit=guillaume2011.fit),
    "pronobis2010": Method(fit=pronobis2010.fit),
    "ranganathan2010": Method(fit=ranganathan2010.fit, fit_with_unknown=partial(ranganathan2010.fit, unknown=True)),
    "filliat2008": Method(fit=filliat2008.fit),
    "mtd": Method(emissions=mtd.fit),
    "second-order": Method(fit=second_order.fit),
}
# What words alone do not tell; `compare` runs these.
NEED_DESCRIPTORS = ("torralba2003", "pronobis2007", "ullah2008", "knn", "logistic", "rbf-svm")


class StepDecoder(SequenceDecoder):
    """A decoder by a system that needs no filter of eq. 1: `make_stepper` begins a sequence.

    Before the first selected word all places are equally probable. `unknown`: the beliefs of the system have one column
    more, the probability that the place is none of `places`. The distance of a frame to its word says nothing here.
    """

    def __init__(
        self,
        training: TrainingSet,
        make_stepper: MakeStepper,
        *,
        selection: Selection,
        max_gap: float | None,
        dictionary: "Dictionary | DictionarySet | None",
        unknown: bool,
    ) -> None:
        self._index = {word: number for number, word in enumerate(training.vocabulary)}
        self._make_stepper, self._unknown = make_stepper, unknown
        super().__init__(
            training.places, {FIRST: self._index}, selection=selection, max_gap=max_gap, dictionary=dictionary
        )

    def _begin(self) -> tuple[Posterior, TakeIn]:
        step, number = self._make_stepper(), self._index
        C = len(self.places)
        columns = C + self._unknown

        def posterior(belief: Floats) -> Posterior:
            if columns == C:
                return belief, None, True
            known = belief[:-1]
            return known / known.sum(), float(belief[-1]), True

        def take_in(words: Sequence[str | None], steps: float | None, distances: Sequence[float | None]) -> Posterior:
            (word,) = words
            return posterior(step(number[word or ""], int(steps or 0)))

        return posterior(np.full(columns, 1 / columns)), take_in


def check_method(name: str, options: Decoding = AS_LEARNED, *, scorer: ScorerName = "native") -> None:
    """Raise ModelError if there is no method of this name for words alone, or no scorer, or if options say nothing."""
    check_scorer(scorer)
    if name in NEED_DESCRIPTORS:
        raise ModelError(f"{name} needs descriptors, not words alone; `placerec compare` runs it")
    if name not in METHODS:
        raise ModelError(f"method {name!r} is unknown; choose one of {', '.join(METHODS)}")
    if name == HOHMM:
        return
    if scorer != "native":
        raise ModelError(f"{name} has no use for another scorer of the language models; leave it out")
    method, allowed = METHODS[name], {"max_gap"}
    if method.emissions is not None:
        allowed = {field.name for field in fields(options)} - {"calibrated", "explain"}
    elif method.fit_with_unknown is not None:
        allowed.add("unknown")
    for field in fields(options):
        unused = (field.default, getattr(PAPER, field.name))
        if field.name not in allowed and getattr(options, field.name) not in unused:
            raise ModelError(f"{name} has no use for {field.name.replace('_', '-')}; leave it out")


def make_decoder(
    name: str,
    model: PlaceModels,
    *,
    options: Decoding = AS_LEARNED,
    dictionary: "Dictionary | DictionarySet | None" = None,
    scorer: ScorerName = "native",
) -> SequenceDecoder:
    """What decodes by the method `name`, on-line or a sequence at a time; for `hohmm` this is `make_recognizer`.

    Systems that have emissions of their own go through the same filter, with the transitions of `options`, by default
    the paper's: what training learned of weights is of `hohmm`. They see the words of the first dictionary. Raises
    ModelError as `check_method`, `read_training_set` and `make_recognizer` do.
    """
    check_method(name, options, scorer=scorer)
    method = METHODS[name]
    fit = (options.unknown and method.fit_with_unknown) or method.fit
    if fit is None:
        if method.emissions is None:
            return make_recognizer(model, options=options, dictionary=dictionary, scorer=scorer)
        emissions, options = method.emissions(read_training_set(model)), as_in_paper(options)
        return make_recognizer(model, options=options, dictionary=dictionary, scorer=scorer, emissions=emissions)
    check_words(model, dictionary)
    training = read_training_set(model)
    return StepDecoder(
        training,
        fit(training),
        selection=model.description.selection,
        max_gap=options.max_gap,
        dictionary=dictionary,
        unknown=options.unknown,
    )


def load_decoder(
    name: str, path: Path | str, *, options: Decoding = AS_LEARNED, scorer: ScorerName = "native"
) -> SequenceDecoder:
    """What decodes a MODEL/ folder by the method `name`, on-line; see `make_decoder`.

    Raises ModelError for options that need later words.
    """
    check_online(options)
    check_method(name, options, scorer=scorer)
    return make_decoder(name, load_model(path), options=options, scorer=scorer)
