"""From images to token streams, kept by content: descriptors per sequence, words per size, seed and fold."""

import glob
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from placerec.errors import ExperimentError, VisionError
from placerec.experiments.grid import cache
from placerec.frames import Sequence as FrameSequence
from placerec.frames import files_of, find_sequences
from placerec.frames.folder import natural_key
from placerec.frames.recordings import is_recording
from placerec.frames.table import FrameTable
from placerec.inspection.word_sheet import draw_word_sheet
from placerec.inspection.words import typical_images, word_table
from placerec.jobs import Executor, Progress
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, describe
from placerec.vision.storage import read_npz, write_npz
from placerec.words.tokenize import tokens_of, write_tokens

SPEC = DescriptorSpec()
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Described:
    """A sequence whose frames are described; the descriptors are in the file `kept`, whose name is their key."""

    sequence: FrameSequence
    kept: Path

    @property
    def key(self) -> str:
        """What the descriptors depend on."""
        return self.kept.stem

    def load(self) -> Descriptors:
        """The descriptors of the frames that could be read, with the labels that the sequence has now."""
        arrays, meta = read_npz(self.kept, ("descriptors", "rows"))
        frames = [self.sequence.frames[row] for row in arrays["rows"].tolist()]
        table = FrameTable.of_frames(self.sequence.name, frames)
        skipped, constant = len(self.sequence.frames) - len(frames), int(meta["constant"])
        return Descriptors(SPEC, arrays["descriptors"], table, skipped, constant)


def find_images(globs: Sequence[str], folder: Path) -> list[FrameSequence]:
    """The sequences in what `globs` name (folders, videos, bags), relative to `folder`; ExperimentError for none."""
    found: dict[str, None] = {}
    for pattern in globs:
        paths = sorted(glob.glob(str(folder / pattern)), key=natural_key)
        usable = [path for path in paths if Path(path).is_dir() or is_recording(Path(path))]
        if not usable:
            remedy = "name folders of images, videos or bags"
            raise ExperimentError(f"[data] sequences: {folder / pattern} is no folder; {remedy}")
        found |= dict.fromkeys(usable)
    return find_sequences(found)


def describe_all(
    sequences: Sequence[FrameSequence], folder: Path, *, work: Executor | None = None, progress: Progress | None = None
) -> list[Described]:
    """Describe every frame, or know it again; one file per sequence in `folder`, which may be used again at once."""
    described = []
    total, done = sum(len(sequence.frames) for sequence in sequences), 0
    for sequence in sequences:
        how = sequence.recording and repr(sequence.recording)
        key = cache.key_of("descriptors", SPEC.as_dict(), how, list(map(cache.content_of, files_of(sequence))))
        one = Described(sequence, folder / f"{key}.npz")
        if not _usable(one):
            _describe(one, work, progress and _shifted(progress, done, total))
        done += len(sequence.frames)
        if progress:
            progress(done, total)
        described.append(one)
    return described


def _shifted(progress: Progress, before: int, total: int) -> Progress:
    return lambda done, of: progress(before + done, total)


def _usable(one: Described) -> bool:
    try:
        one.load()
    except (VisionError, KeyError, IndexError):
        return False
    return True


def _describe(one: Described, work: Executor | None, progress: Progress | None) -> None:
    # Equal names in one folder cannot be.
    row = {frame.name: number for number, frame in enumerate(one.sequence.frames)}
    found = describe([one.sequence], SPEC, work=work, progress=progress)
    rows = np.array([row[name] for name in found.frames], np.int64)
    write_npz(one.kept, {"descriptors": found.values, "rows": rows}, {"constant": found.constant})


@dataclass(frozen=True)
class TokensJob:
    """The words of one size and seed, of the sequences `train`, and the token streams of all sequences of a fold."""

    train: tuple[Described, ...]
    test: tuple[Described, ...]
    size: int
    seed: int
    units: str
    cache: Path

    @property
    def words(self) -> Path:
        """The dictionary's file."""
        parts = ([one.key for one in self.train], self.size, self.seed, self.units)
        return self.cache / "words" / f"{cache.key_of('words', SPEC.as_dict(), *parts)}.npz"

    @property
    def folder(self) -> Path:
        """The token streams' folder."""
        labels = [
            (one.sequence.name, one.key, [(f.name, repr(f.time), f.place) for f in one.sequence.frames])
            for one in (*self.train, *self.test)
        ]
        return self.cache / "tokens" / cache.key_of("tokens", self.words.stem, labels)

    @property
    def made(self) -> bool:
        """Whether all that `make_tokens` writes is there."""
        names = [f"{one.sequence.name}.tsv" for one in (*self.train, *self.test)]
        folder = self.folder
        return self.words.exists() and all((folder / name).exists() for name in (*names, "vocab.txt"))


def make_tokens(job: TokensJob) -> None:
    """Learn the words and write the token streams, as `train-words` and `tokenize` do."""
    training = Descriptors.concat([one.load() for one in job.train])
    try:
        dictionary = Dictionary.load(job.words)
    except VisionError:
        dictionary = Dictionary.fit(training.values, spec=SPEC, size=job.size, seed=job.seed, units=job.units)
        dictionary.save(job.words)
    test = Descriptors.concat([one.load() for one in job.test])
    streams = tokens_of(training, dictionary) + tokens_of(test, dictionary)
    write_tokens(streams, dictionary, job.folder)


def draw_words(job: TokensJob, path: Path) -> None:
    """Draw what the words look like among the test frames, as `show-words` does."""
    sequences = [one.sequence for one in job.test]
    words = word_table(Descriptors.concat([one.load() for one in job.test]), Dictionary.load(job.words))
    title = f"The words of S = {job.size}, seed {job.seed}, among the test frames"
    draw_word_sheet(words, typical_images(words, sequences), path, title=title)
