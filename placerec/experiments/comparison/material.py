"""What a comparison of methods is made of: frames described once, words, and the same streams for all.

What takes time is kept in a cache folder, in files that are named by a digest of what they were made of.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from placerec.errors import EvaluationError, SourceError
from placerec.files import read_text, write_text
from placerec.frames import Sequence as FrameSequence
from placerec.frames import files_of, images_at
from placerec.frames.sequence import Gray
from placerec.frames.table import FrameTable
from placerec.jobs import Progress
from placerec.version import __version__
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, describe, descriptor, save_descriptors
from placerec.vision.external import read_rows
from placerec.vision.pca import project
from placerec.words import WordStream
from placerec.words.tokenize import tokens_of

GIST, CENTRIST = DescriptorSpec(), DescriptorSpec(kind="centrist")
# Frames that are described before they are written.
BATCH = 2000
# Images that the cost of the front end is measured on.
TIMED = 30


@dataclass(frozen=True)
class Front:
    """Microseconds that come before every method: an image's descriptor, and its word."""

    descriptor: float
    word: float


@dataclass(frozen=True)
class Look:
    """All sequences through one dictionary: `streams` in order, `points` float32 (T, k) in components, and `front`."""

    dictionary: Dictionary
    streams: tuple[WordStream, ...] = field(repr=False)
    points: tuple[NDArray[np.float32], ...] = field(repr=False)
    front: Front

    def units(self, sequence: int) -> NDArray[np.int64]:
        """The words of a sequence as numbers."""
        number = {word: unit for unit, word in enumerate(self.dictionary.vocabulary)}
        return np.array([number[word] for word in self.streams[sequence].words], np.int64)


def look(
    sequences: Sequence[FrameSequence],
    training: int,
    spec: DescriptorSpec,
    *,
    size: int,
    seed: int,
    cache: Path,
    progress: Progress | None = None,
) -> Look:
    """Describe all sequences, learn words on the first `training` of them, and give all frames their words."""
    found = _described(sequences, spec, cache, progress)
    values = np.concatenate([one.values for one in found[:training]])
    dictionary = _dictionary(values, spec, size, seed, cache)
    streams = [stream for one in found for stream in tokens_of(one, dictionary)]
    points = [project(one.values, dictionary.pca) for one in found]
    front = _front(sequences[training:], found[training:], dictionary, cache)
    return Look(dictionary, tuple(streams), tuple(points), front)


def digest(*parts: object) -> str:
    """32 hexadecimal digits of the content of arrays and of what JSON can hold."""
    total = hashlib.blake2b(digest_size=16)
    for part in parts:
        data = part.tobytes() if isinstance(part, np.ndarray) else json.dumps(part, sort_keys=True).encode()
        total.update(len(data).to_bytes(8, "big") + data)
    return total.hexdigest()


def _described(
    sequences: Sequence[FrameSequence], spec: DescriptorSpec, cache: Path, progress: Progress | None
) -> list[Descriptors]:
    """The descriptors of each sequence, from the cache where it has them."""
    paths = [cache / f"descriptors-{_content(sequence, spec)}.npz" for sequence in sequences]
    missing = [(s, path) for s, path in zip(sequences, paths, strict=True) if not path.exists()]
    total = sum(len(sequence.frames) for sequence, _ in missing)
    done = 0
    for batch in _batches(missing):
        tell = None if progress is None else lambda n, _, start=done: progress(start + n, total)
        both = describe([sequence for sequence, _ in batch], spec, progress=tell)
        rows = both.table.by_sequence()
        for sequence, path in batch:
            if sequence.name not in rows:
                raise EvaluationError(f"{sequence.source}: none of its images can be read; leave the sequence out")
            save_descriptors(both.take(rows[sequence.name]), path)
        done += sum(len(sequence.frames) for sequence, _ in batch)
    return [_restored(sequence, spec, path) for sequence, path in zip(sequences, paths, strict=True)]


def _content(sequence: FrameSequence, spec: DescriptorSpec) -> str:
    """A digest of a sequence's images; labels and times may change without them."""
    names = [frame.name for frame in sequence.frames]
    how = sequence.recording and repr(sequence.recording)
    return digest(sequence.name, names, how, list(map(_hash, files_of(sequence))), spec.as_dict(), __version__)


def _hash(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    except OSError as error:
        raise EvaluationError(f"{path}: cannot be read: {error.strerror}") from error


def _batches(missing: Sequence[tuple[FrameSequence, Path]]) -> Iterator[list[tuple[FrameSequence, Path]]]:
    batch: list[tuple[FrameSequence, Path]] = []
    for one in missing:
        batch.append(one)
        if sum(len(sequence.frames) for sequence, _ in batch) >= BATCH:
            yield batch
            batch = []
    if batch:
        yield batch


def _restored(sequence: FrameSequence, spec: DescriptorSpec, path: Path) -> Descriptors:
    """What the file holds, with the sequence's present labels and times."""
    values, kept = read_rows(path, [(sequence.name, frame.name) for frame in sequence.frames])
    found = [sequence.frames[k] for k in kept]
    return Descriptors(spec, values, FrameTable.of_frames(sequence.name, found), len(sequence.frames) - len(found))


def _dictionary(values: NDArray[np.float32], spec: DescriptorSpec, size: int, seed: int, cache: Path) -> Dictionary:
    path = cache / f"words-{digest(values, spec.as_dict(), size, seed, __version__)}.npz"
    if not path.exists():
        Dictionary.fit(values, spec=spec, size=size, seed=seed).save(path)
    return Dictionary.load(path)


def _front(
    sequences: Sequence[FrameSequence], found: Sequence[Descriptors], dictionary: Dictionary, cache: Path
) -> Front:
    """What a frame costs up to its word, one at a time, as the mean over some images; reading them is not counted."""
    path = cache / f"front-{digest(dictionary.fingerprint, [s.name for s in sequences])}.json"
    if not path.exists():
        spent, timed = np.zeros(2), 0
        for gray in _spread_images(sequences, found):
            started = perf_counter()
            row = descriptor(gray, dictionary.spec)[None]
            described = perf_counter()
            dictionary.words(row)
            spent += described - started, perf_counter() - described
            timed += 1
        names = ("descriptor", "word")
        write_text(path, json.dumps(dict(zip(names, (1e6 * spent / timed).tolist(), strict=True))) + "\n")
    return Front(**json.loads(read_text(path, EvaluationError)))


def _spread_images(sequences: Sequence[FrameSequence], found: Sequence[Descriptors]) -> Iterator[Gray]:
    """Some images of those that have a descriptor, from all of the recordings."""
    usable = []
    for number, (sequence, one) in enumerate(zip(sequences, found, strict=True)):
        names = set(one.frames)
        usable += [(number, k) for k, frame in enumerate(sequence.frames) if frame.name in names]
    chosen = [usable[i] for i in np.unique(np.linspace(0, len(usable) - 1, TIMED).astype(int))]
    for number, sequence in enumerate(sequences):
        for image in images_at(sequence, [k for its, k in chosen if its == number]):
            if isinstance(image, str):
                raise SourceError(image)
            yield image
