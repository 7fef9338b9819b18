"""How much words weigh against the prediction (`hohmm.weights`), learned from the training sequences alone.

The sequences are put in at most GROUPS groups; each group is judged by models and transitions of the others. From token
streams the words are those that all sequences together trained; who has the descriptors does the words anew, too.
"""

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from placerec.arrays import Ints
from placerec.errors import LanguageModelError, VisionError
from placerec.hohmm.evidence import DictionaryModels, evidence_in
from placerec.hohmm.weights import HeldOut, Weights, choose_weights, shares_of
from placerec.lm import NgramCounts, count_ngrams
from placerec.lm.arpa import as_printed
from placerec.lm.backoff import unite_models
from placerec.lm.counts import add_counts
from placerec.model.options import ModelOptions, estimate_place
from placerec.model.record import Route, labelled_frames, route_table, table_routes
from placerec.words import Sentences, WordStream, place_steps, sentences_per_place

GROUPS = 5
# Words that are in memory as text before they are counted.
TOGETHER = 1 << 16
# A dictionary's name and a place.
Key = tuple[str, str]
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PlaceCounts:
    """What sequences tell of the places: the n-grams of each dictionary, frames, and steps from frame to frame.

    `sentences`: those that were counted, where models are fitted to sentences.
    """

    ngrams: Mapping[Key, NgramCounts] = field(repr=False)
    frames: Counter[str]
    steps: Counter[Route]
    sentences: Mapping[Key, Sentences] = field(default_factory=dict, repr=False)

    @property
    def places(self) -> list[str]:
        """The places that some frame is labelled with, in alphabetical order."""
        return sorted(self.frames)

    def step_counts(self) -> Ints:
        """How often a frame at places[i] was followed by one at places[j], int64 (C, C)."""
        return route_table(self.steps, self.places, 2)

    def frame_counts(self) -> Ints:
        """The number of labelled frames of each place, int64 (C,)."""
        return np.array([self.frames[place] for place in self.places], np.int64)

    @staticmethod
    def sum(parts: Sequence["PlaceCounts"]) -> "PlaceCounts":
        """What all parts tell together; `parts` holds at least one."""
        keys = dict.fromkeys(key for part in parts for key in part.ngrams)
        ngrams = {key: add_counts(*(part.ngrams[key] for part in parts if key in part.ngrams)) for key in keys}
        frames, steps, sentences = Counter[str](), Counter[Route](), dict[Key, Sentences]()
        for part in parts:
            frames.update(part.frames)
            steps.update(part.steps)
            for key, text in part.sentences.items():
                sentences.setdefault(key, []).extend(text)
        return PlaceCounts(ngrams, frames, steps, sentences)


def count_places(
    streams: Iterable[WordStream], vocabularies: Mapping[str, Sequence[str]], options: ModelOptions
) -> PlaceCounts:
    """What labelled streams tell of the places; `vocabularies`: the words of each dictionary, by its name."""
    ngrams: dict[Key, NgramCounts] = {}
    waiting: dict[Key, Sentences] = {}
    kept: dict[Key, Sentences] = {}
    frames, steps = Counter[str](), Counter[Route]()
    words = 0

    def count() -> None:
        for key, text in waiting.items():
            counted = count_ngrams(text, options.order, vocabulary=vocabularies[key[0]], markers=options.markers)
            ngrams[key] = add_counts(ngrams[key], counted) if key in ngrams else counted
            if options.holds_out:
                kept.setdefault(key, []).extend(text)
        waiting.clear()

    for stream in streams:
        for name in vocabularies:
            for place, text in sentences_per_place([stream.in_dictionary(name)], options.select).items():
                waiting.setdefault((name, place), []).extend(text)
        found = labelled_frames(stream)
        places = sorted(found)
        steps.update(table_routes(place_steps(stream, places), places))
        frames.update(found)
        words += len(stream)
        if words > TOGETHER:
            count()
            words = 0
    count()
    return PlaceCounts(ngrams, frames, steps, kept)


def held_out(
    training: PlaceCounts,
    streams: Iterable[WordStream],
    vocabularies: Mapping[str, Sequence[str]],
    options: ModelOptions,
    group: int = 0,
    views: Sequence[str] = (),
) -> Iterator[HeldOut]:
    """Streams that trained nothing, as models and transitions of `training` see them.

    `group`, `views`: see `HeldOut`; the views in the order of `vocabularies`. Frames of places that the training does
    not know are not judged. Raises LanguageModelError if no model can be estimated.
    """
    places = training.places
    if not places:
        return
    dictionaries = []
    for name, words in vocabularies.items():
        keys = [(name, place) for place in places]
        models = [
            as_printed(estimate_place(training.ngrams[key], options, training.sentences.get(key, ()))) for key in keys
        ]
        dictionaries.append(DictionaryModels(name, unite_models(models), frozenset(words)))
    steps, shares = training.step_counts(), shares_of(training.frame_counts())
    for stream in streams:
        (part,) = evidence_in(stream, dictionaries, selection=options.select, per="frame", max_gap=None)
        yield HeldOut(part, stream.table.places.codes(places), steps, shares, group, tuple(views))


def group_borders(sequences: int) -> list[slice]:
    """At most GROUPS groups of sequences, each of neighbours, as slices; none for fewer than two sequences."""
    if sequences < 2:
        return []
    borders = np.linspace(0, sequences, min(GROUPS, sequences) + 1).round().astype(int).tolist()
    return [slice(first, last) for first, last in pairwise(borders)]


def learn_weights(
    sequences: Sequence[Callable[[], WordStream]], vocabularies: Mapping[str, Sequence[str]], options: ModelOptions
) -> Weights:
    """The weights of words in token streams, which `sequences` read: models and transitions are redone, words are not.

    With fewer than two sequences, or where the models of fewer cannot be estimated: alpha 1 / dictionaries, memory 0.
    """
    groups = [sequences[group] for group in group_borders(len(sequences))]
    counted = [count_places((read() for read in group), vocabularies, options) for group in groups]

    def sequences_held_out() -> Iterator[HeldOut]:
        for g, group in enumerate(groups):
            training = PlaceCounts.sum(counted[:g] + counted[g + 1 :])
            yield from held_out(training, (read() for read in group), vocabularies, options)

    return chosen(sequences_held_out(), len(vocabularies))


def chosen(sequences: Iterable[HeldOut], dictionaries: int) -> Weights:
    """The weights that are best on held-out sequences, or those without any if nothing can be learned without some."""
    try:
        return choose_weights(sequences, dictionaries)
    except (LanguageModelError, VisionError) as error:
        log.warning("the weight of words cannot be learned: without some of the sequences, %s", error)
        return choose_weights([], dictionaries)
