"""What experiments keep from one run to the next: descriptors, dictionaries, token streams and results.

A file is named by a digest of all inputs and options that it was made of, of FORMAT and of placerec's version: whatever
changes, only what depends on it is made again. Each file is there whole or not at all; any of them may be removed.

descriptors/KEY.npz  of one sequence
words/KEY.npz        a dictionary
tokens/KEY/          token streams of several sequences
relit/KEY/NAME/      a sequence in simulated light
NAME/KEY.json        plain values: results of a grid's cells, times
models/KEY/          n-gram models of a comparison
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from placerec.errors import ExperimentError, OutputError, PlacerecError, VisionError
from placerec.files import content_digest, content_digest_of_file, held_folder, read_text, sweep_files, write_text
from placerec.frames import Sequence as FrameSequence, files_of
from placerec.frames.table import FrameTable
from placerec.jobs import Executor, Progress
from placerec.version import __version__
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, DictionaryOptions, DictionarySet, describe
from placerec.vision.storage import read_npz, write_npz
from placerec.vision.work import DESCRIBED
from placerec.words.folder import VOCABULARY, write_tokens
from placerec.words.tokenize import tokens_of

FORMAT = "placerec experiments 3"


def key_of(*parts: object) -> str:
    """What a result is kept under that depends on these parts (bytes, or plain values): 64 hexadecimal digits."""
    return content_digest(FORMAT, __version__, *parts)


def load(path: Path) -> dict[str, Any]:
    """The plain values that `save` wrote to a file, empty if there is none or it cannot be read."""
    try:
        content = json.loads(read_text(path, PlacerecError))
    except (PlacerecError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def save(path: Path, content: dict[str, Any]) -> None:
    """Keep plain values; numbers come back to the last digit."""
    write_text(path, json.dumps(content, ensure_ascii=True, separators=(",", ":")) + "\n")


@contextmanager
def held_output(out: Path, cache: Path) -> Iterator[None]:
    """Make the folders of a run if need be, keep other runs out of `out`, and clear away files that a killed one left.

    Raises OutputError if a folder cannot be written or another run is at work there.
    """
    for folder in (out, cache):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
    with held_folder(out):
        for folder in (out, *(out / "cache").glob("*/")):
            sweep_files(folder)
        yield


@dataclass(frozen=True)
class Described:
    """A sequence whose descriptors are in the file `kept`, which is named by a digest of images and descriptor.

    `spec`: of the descriptors that are wanted, and `whole`: of those in the file, of which these are a part; None where
    they are all.
    """

    sequence: FrameSequence
    spec: DescriptorSpec
    kept: Path
    whole: DescriptorSpec | None = None

    @property
    def key(self) -> str:
        """A digest of images and descriptors that are wanted."""
        return self.kept.stem if self.spec == self._whole else key_of("part", self.kept.stem, self.spec.as_dict())

    @property
    def _whole(self) -> DescriptorSpec:
        return self.whole or self.spec

    def part(self, spec: DescriptorSpec) -> "Described":
        """The sequence with those of the descriptors in the file that `spec` tells."""
        return replace(self, spec=spec, whole=self._whole)

    def load(self) -> Descriptors:
        """The descriptors of the frames that could be read, with the times and labels that the sequence has now."""
        arrays, _ = read_npz(self.kept, ("descriptors", "rows"))
        frames = [self.sequence.frames[row] for row in arrays["rows"].tolist()]
        table = FrameTable.of_frames(self.sequence.name, frames)
        skipped = len(self.sequence.frames) - len(frames)
        return Descriptors(self._whole, arrays["descriptors"], table, skipped).part(self.spec)


def describe_all(
    sequences: Sequence[FrameSequence],
    spec: DescriptorSpec,
    cache: Path,
    *,
    together: int = 2000,
    work: Executor | None = None,
    progress: Progress | None = None,
) -> list[Described]:
    """Describe the frames of all sequences whose descriptors are not in the folder `cache` yet.

    If other commands keep descriptors there, too (their `--cache`), these are taken, and new ones kept for them.
    `together`: frames that are described before their descriptors are written. `work`: who does the work
    (`jobs.workers`), None for threads. `progress` is called with frames done and in all. Raises ExperimentError
    for a file that cannot be read and for a sequence without a readable image.
    """
    folder = cache / "descriptors"
    described = [Described(one, spec, folder / f"{_key(one, spec)}.npz") for one in sequences]
    missing = [one for one in described if not _usable(one)]
    total = sum(len(one.sequence.frames) for one in described)
    done = total - sum(len(one.sequence.frames) for one in missing)
    if progress and done:
        progress(done, total)
    some: list[Described] = []
    for one in missing:
        some.append(one)
        frames = sum(len(each.sequence.frames) for each in some)
        if frames >= together or one is missing[-1]:
            shown = (lambda n, _, start=done: progress(start + n, total)) if progress else None
            _describe(some, spec, work, cache if (cache / DESCRIBED).is_dir() else None, shown)
            done, some = done + frames, []
    return described


def keep_given(
    sequences: Sequence[FrameSequence], spec: DescriptorSpec | None, matrix: Path | str, cache: Path
) -> list[Described]:
    """Sequences that are described by a matrix that was computed elsewhere, `vision.describe` tells of which kind.

    `spec`: what the descriptors are to be, None for whatever the matrix holds. Raises VisionError for a matrix that
    cannot be used, and ExperimentError for a sequence without a row.
    """
    found = describe(sequences, spec, matrix=matrix)
    described = []
    for one, own in _by_sequence(found, sequences, f"{matrix} has no row for its frames"):
        digest = key_of("given", own.values, list(own.table.names))
        described.append(Described(one, found.spec, cache / "descriptors" / f"{digest}.npz"))
        _keep(described[-1], own)
    return described


def _key(sequence: FrameSequence, spec: DescriptorSpec) -> str:
    """A digest of a sequence's images; labels, times and names may change without them."""
    return key_of("descriptors", spec.as_dict(), *images_of(sequence))


def images_of(sequence: FrameSequence) -> list[object]:
    """What a sequence's images depend on, as parts of a key: how they are read, and digests of the files."""
    how = sequence.recording and repr(sequence.recording)
    return [how, [content_digest_of_file(path, ExperimentError) for path in files_of(sequence)]]


def _usable(one: Described) -> bool:
    try:
        one.load()
    except (VisionError, KeyError, IndexError):
        return False
    return True


def _describe(
    some: Sequence[Described],
    spec: DescriptorSpec,
    work: Executor | None,
    shared: Path | None,
    progress: Progress | None,
) -> None:
    sequences = [one.sequence for one in some]
    found = describe(sequences, spec, work=work, cache=shared, progress=progress)
    for one, (_, own) in zip(some, _by_sequence(found, sequences, "none of its images can be read"), strict=True):
        _keep(one, own)


def _by_sequence(
    found: Descriptors, sequences: Sequence[FrameSequence], reason: str
) -> Iterator[tuple[FrameSequence, Descriptors]]:
    """The descriptors of each sequence; ExperimentError that tells the `reason` for one without any."""
    rows = found.table.by_sequence()
    for one in sequences:
        if one.name not in rows:
            raise ExperimentError(f"{one.source}: {reason}; leave the sequence out")
        yield one, found.take(rows[one.name])


def _keep(one: Described, own: Descriptors) -> None:
    # Equal names in one sequence cannot be.
    number = {frame.name: k for k, frame in enumerate(one.sequence.frames)}
    kept = np.array([number[name] for name in own.table.names], np.int64)
    write_npz(one.kept, {"descriptors": own.values, "rows": kept}, {})


@dataclass(frozen=True)
class WordsJob:
    """The words of one map, learned on the sequences `train`, and the token streams of these and of `test`.

    `cache`: the folder where all of it is kept.
    """

    train: tuple[Described, ...]
    test: tuple[Described, ...]
    options: DictionaryOptions
    cache: Path

    def part(self, spec: DescriptorSpec) -> "WordsJob":
        """The job with some of the descriptors that were made of its sequences (`Described.part`)."""
        train, test = (tuple(one.part(spec) for one in some) for some in (self.train, self.test))
        return replace(self, train=train, test=test)

    @property
    def words(self) -> Path:
        """The dictionary's file."""
        key = key_of("words", [one.key for one in self.train], asdict(self.options))
        return self.cache / "words" / f"{key}.npz"

    @property
    def labels(self) -> list[object]:
        """All that is known of the frames but for the words, as a part of a key."""
        return [
            (one.sequence.name, one.key, [(f.name, repr(f.time), f.place) for f in one.sequence.frames])
            for one in (*self.train, *self.test)
        ]

    @property
    def folder(self) -> Path:
        """The token streams' folder."""
        return self.cache / "tokens" / key_of("tokens", self.words.stem, self.labels)

    @property
    def made(self) -> bool:
        """Whether all that `make_tokens` writes is there."""
        names = [f"{one.sequence.name}.tsv" for one in (*self.train, *self.test)]
        folder = self.folder
        return self.words.exists() and all((folder / name).exists() for name in (*names, VOCABULARY))

    def dictionary(self) -> Dictionary:
        """The dictionary, which is learned and kept if there is none yet."""
        try:
            return Dictionary.load(self.words)
        except VisionError:
            values = np.concatenate([one.load().values for one in self.train])
            spec = self.train[0].spec
            Dictionary.fit(values, spec=spec, options=self.options).save(self.words)
        return Dictionary.load(self.words)


def make_tokens(job: WordsJob) -> None:
    """Learn the words and write the token streams, as `placerec train-words` and `placerec tokenize` do."""
    dictionary = job.dictionary()
    streams = (stream for one in (*job.train, *job.test) for stream in tokens_of(one.load(), dictionary))
    write_tokens(streams, DictionarySet.of(dictionary), job.folder)
