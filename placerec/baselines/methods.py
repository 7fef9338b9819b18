"""Every system that learns from words alone, by name."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from placerec.baselines import (
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
from placerec.baselines.lesson import Follow, Lesson
from placerec.hohmm import Emissions


@dataclass(frozen=True)
class Method:
    """A system: either `emissions`, for the filter of eq. 1, or `follow`, beliefs without it; neither: `hohmm`.

    `follow_unknown`: `follow` with one column more, the probability that the place is none of the model's.
    """

    emissions: Callable[[Lesson], Emissions] | None = None
    follow: Callable[[Lesson], Follow] | None = None
    follow_unknown: Callable[[Lesson], Follow] | None = None


HOHMM = "hohmm"
METHODS: dict[str, Method] = {
    HOHMM: Method(),
    "majority": Method(follow=majority.fit),
    "naive-bayes": Method(follow=naive_bayes.fit),
    "wu2009": Method(emissions=wu2009.fit),
    "dubois2011": Method(emissions=dubois2011.fit),
    "guillaume2011": Method(follow=guillaume2011.fit),
    "pronobis2010": Method(follow=pronobis2010.fit),
    "ranganathan2010": Method(follow=ranganathan2010.fit, follow_unknown=partial(ranganathan2010.fit, unknown=True)),
    "filliat2008": Method(follow=filliat2008.fit),
    "mtd": Method(emissions=mtd.fit),
    "second-order": Method(follow=second_order.fit),
}
# What words alone do not tell; `compare` runs these.
NEED_DESCRIPTORS = ("torralba2003", "pronobis2007", "ullah2008", "knn")
