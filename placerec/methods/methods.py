"""Every system that learns from words alone, by name."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from placerec.hohmm import Emissions
from placerec.methods import (
    dubois2011,
    filliat2008,
    guillaume2011,
    majority,
    mtd,
    naive_bayes,
    pronobis2010,
    ranganathan2010,
    second_order,
    wu2009,
)
from placerec.methods.training_set import MakeStepper, TrainingSet


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
    "majority": Method(fit=majority.fit),
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
NEED_DESCRIPTORS = ("torralba2003", "pronobis2007", "ullah2008", "knn")
