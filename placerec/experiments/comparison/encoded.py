"""All sequences of a comparison through one dictionary: words and components of every frame, and what those cost."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from time import perf_counter

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.errors import SourceError
from placerec.experiments.store import WordsJob, key_of, load, save
from placerec.frames import Sequence as FrameSequence
from placerec.frames import images_at
from placerec.frames.sequence import Gray
from placerec.vision import Descriptors, Dictionary, descriptor
from placerec.vision.pca import project
from placerec.words import WordStream
from placerec.words.tokenize import tokens_of

# Images that the cost of the front end is measured on.
TIMED = 30


@dataclass(frozen=True)
class FrontEndCost:
    """Microseconds that a frame takes before any method sees it: for its descriptor, and from that to its word."""

    descriptor: float
    word: float


@dataclass(frozen=True)
class EncodedSequences:
    """All sequences through one dictionary, those of the training first.

    `streams`: the words of each sequence; `points` float32 (T, k): the principal components of its T frames.
    """

    dictionary: Dictionary
    streams: tuple[WordStream, ...] = field(repr=False)
    points: tuple[Singles, ...] = field(repr=False)
    cost: FrontEndCost

    def units(self, sequence: int) -> Ints:
        """The words of a sequence as numbers of units, int64 (T,)."""
        number = {word: unit for unit, word in enumerate(self.dictionary.vocabulary)}
        return np.array([number[word] for word in self.streams[sequence].words], np.int64)


def encode(job: WordsJob) -> EncodedSequences:
    """Learn the words of a job, and give all frames of the job theirs. Raises VisionError or SourceError for images."""
    dictionary = job.dictionary()
    found = [one.load() for one in (*job.train, *job.test)]
    streams = tuple(stream for one in found for stream in tokens_of(one, dictionary))
    points = tuple(project(one.values, dictionary.pca) for one in found)
    return EncodedSequences(dictionary, streams, points, _cost(job, found[len(job.train) :], dictionary))


def _cost(job: WordsJob, tests: Sequence[Descriptors], dictionary: Dictionary) -> FrontEndCost:
    """The mean over some test images, one at a time; reading them is not counted."""
    sequences = [one.sequence for one in job.test]
    path = job.cache / "costs" / f"{key_of(dictionary.fingerprint, [s.name for s in sequences])}.json"
    kept = load(path)
    if kept:
        return FrontEndCost(**kept)
    spent, timed = np.zeros(2), 0
    for gray in _spread_images(sequences, tests):
        started = perf_counter()
        row = descriptor(gray, dictionary.spec)[None]
        described = perf_counter()
        dictionary.words(row)
        spent += described - started, perf_counter() - described
        timed += 1
    cost = FrontEndCost(*(1e6 * spent / timed).tolist())
    save(path, asdict(cost))
    return cost


def _spread_images(sequences: Sequence[FrameSequence], found: Sequence[Descriptors]) -> Iterator[Gray]:
    """Some images of those that have a descriptor, from all of the recordings."""
    usable = []
    for number, (sequence, one) in enumerate(zip(sequences, found, strict=True)):
        names = set(one.table.names)
        usable += [(number, k) for k, frame in enumerate(sequence.frames) if frame.name in names]
    chosen = [usable[i] for i in np.unique(np.linspace(0, len(usable) - 1, TIMED).astype(int))]
    for number, sequence in enumerate(sequences):
        for image in images_at(sequence, [k for own, k in chosen if own == number]):
            if isinstance(image, str):
                raise SourceError(image)
            yield image
