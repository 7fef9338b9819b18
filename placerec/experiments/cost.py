"""What a frame costs before any method sees it."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from time import perf_counter

import numpy as np

from placerec.arrays import Singles
from placerec.errors import SourceError
from placerec.experiments.store import WordsJob, key_of, load, save
from placerec.frames import Sequence as FrameSequence, images_at
from placerec.frames.sequence import Image
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, DictionarySet, descriptor

# Images that the cost is measured on, and descriptors that it is where these were computed elsewhere.
TIMED, MANY = 30, 300


@dataclass(frozen=True)
class FrontEndCost:
    """Microseconds that a frame takes before any method sees it: for its descriptor, and from that to its word.

    `descriptor` is nan where that was computed elsewhere.
    """

    descriptor: float
    word: float


def front_end_cost(job: WordsJob, tests: Sequence[Descriptors], dictionary: Dictionary | DictionarySet) -> FrontEndCost:
    """The median over some test images, one at a time; reading them is not counted.

    `tests`: the descriptors of the job's test sequences.
    """
    sequences = [one.sequence for one in job.test]
    path = job.cache / "costs" / f"{key_of(dictionary.fingerprint, [s.name for s in sequences])}.json"
    kept = load(path)
    if kept:
        return FrontEndCost(**kept)
    if dictionary.spec.kind == "npy":
        cost = FrontEndCost(math.nan, _microseconds_of_words(dictionary, tests))
    else:
        cost = _measured(sequences, tests, dictionary.spec, dictionary.words)
    save(path, asdict(cost))
    return cost


def description_cost(job: WordsJob, tests: Sequence[Descriptors], spec: DescriptorSpec) -> float:
    """The microseconds of `front_end_cost` that it takes to describe a frame by `spec`, which is made of images."""
    sequences = [one.sequence for one in job.test]
    path = job.cache / "costs" / f"{key_of('description', spec.as_dict(), [s.name for s in sequences])}.json"
    kept = load(path)
    if not kept:
        kept = {"descriptor": _measured(sequences, tests, spec, lambda row: None).descriptor}
        save(path, kept)
    return float(kept["descriptor"])


def _measured(
    sequences: Sequence[FrameSequence],
    tests: Sequence[Descriptors],
    spec: DescriptorSpec,
    use: Callable[[Singles], object],
) -> FrontEndCost:
    """What it takes to describe an image, and for a row of one descriptor to be used."""
    spent = []
    for image in _spread_images(sequences, tests, spec.colours):
        started = perf_counter()
        row = descriptor(image, spec)[None]
        described = perf_counter()
        use(row)
        spent.append((described - started, perf_counter() - described))
    # Not the mean, which other work on the machine moves.
    return FrontEndCost(*(1e6 * np.median(spent, axis=0)).tolist())


def _spread_images(sequences: Sequence[FrameSequence], found: Sequence[Descriptors], colours: bool) -> Iterator[Image]:
    """Some images of those that have a descriptor, from all of the recordings."""
    usable = []
    for number, (sequence, one) in enumerate(zip(sequences, found, strict=True)):
        names = set(one.table.names)
        usable += [(number, k) for k, frame in enumerate(sequence.frames) if frame.name in names]
    chosen = [usable[i] for i in np.unique(np.linspace(0, len(usable) - 1, TIMED).astype(int))]
    for number, sequence in enumerate(sequences):
        for image in images_at(sequence, [k for own, k in chosen if own == number], colours=colours):
            if isinstance(image, str):
                raise SourceError(image)
            yield image


def _microseconds_of_words(dictionaries: Dictionary | DictionarySet, described: Sequence[Descriptors]) -> float:
    """How long a descriptor takes to become words, one after the other, the mean over the first MANY."""
    rows = [row[None] for row in np.concatenate([one.values for one in described])[:MANY]]
    dictionaries.words(rows[0])
    started = perf_counter()
    for row in rows:
        dictionaries.words(row)
    return 1e6 * (perf_counter() - started) / len(rows)
