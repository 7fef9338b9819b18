"""Labels that a model proposes: the most probable path through a drive, and where to look at it first."""

import logging
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from placerec.arrays import Floats
from placerec.errors import ModelError, PlacerecError
from placerec.frames import Sequence as FrameSequence
from placerec.frames.label_files import runs
from placerec.frames.table import FrameTable, Labels
from placerec.model import ModelOptions, load_model, make_recognizer
from placerec.model.folder import ModelFolder
from placerec.model.learn import learn_folder
from placerec.vision import DEFAULT_KIND, Descriptors, DescriptorSpec, DictionarySet, DictionarySetOptions, describe
from placerec.words.tokenize import streams_of_rows

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Proposal:
    """What a model proposes for n frames: `places`, the most probable path; `doubt` float64 (n,), the probability that
    the frame is elsewhere by all words before and behind it."""

    places: tuple[str, ...]
    doubt: Floats


@dataclass(frozen=True)
class Look:
    """A stretch of a proposal that should be looked at: `label`, the label that it contradicts, "" if it has none.

    `doubt`: the mean of its frames.
    """

    start: int
    end: int
    place: str
    label: str
    doubt: float


def propose(described: Descriptors, names: Sequence[str], model: Path) -> Proposal:
    """What the model in a folder, with its words.npz, proposes for the frames of one sequence.

    `described`: those frames that can be read, `names`: all of them; one that cannot be read is where the one before it
    is. Raises ModelError for a model that cannot be loaded, VisionError for descriptors of another kind.
    """
    models = load_model(model)
    dictionary = DictionarySet.load(models.folder.words)
    (stream,) = streams_of_rows(described.values, described.table, dictionary, described.spec)
    recognizer = make_recognizer(models, dictionary=dictionary)
    path = recognizer.decode(stream, viterbi=True).best
    beliefs = recognizer.decode(stream, smooth=True)
    column = {place: number for number, place in enumerate(beliefs.places)}
    sure = beliefs.belief[np.arange(len(path)), [column[place] for place in path]]
    row = {name: number for number, name in enumerate(stream.frames)}
    rows = np.array([row.get(name, -1) for name in names])
    rows = np.maximum.accumulate(np.where(rows < 0, 0, rows))
    return Proposal(tuple(path[number] for number in rows.tolist()), np.clip(1 - sure[rows], 0, 1))


def look_first(proposal: Proposal, labels: Sequence[str]) -> list[Look]:
    """Where a proposal contradicts the labels, the longest first; then where it is least sure of what has no label."""
    both = list(zip(proposal.places, labels, strict=True))
    found = []
    for start, end, key in runs([f"{place}\t{label}" for place, label in both]):
        place, label = key.split("\t")
        if label != place:
            found.append(Look(start, end, place, label, float(proposal.doubt[start:end].mean())))
    return sorted(found, key=lambda look: (not look.label, look.start - look.end if look.label else -look.doubt))


def learn_from(described: Sequence[Descriptors], labels: Sequence[Sequence[str]], folder: Path) -> None:
    """Learn a MODEL/ folder that is there, and empty, from drives and the place of each of their described frames.

    What `placerec learn` does with these sequences; a drive without any label teaches nothing. Raises ModelError for
    fewer than two places.
    """
    some = [number for number, places in enumerate(labels) if any(places)]
    if len({place for number in some for place in labels[number]} - {""}) < 2:
        raise ModelError("a model of one place proposes nothing else; label two places at least")
    drives = [replace(described[i], table=replace(described[i].table, places=Labels(labels[i]))) for i in some]
    values = np.concatenate([drive.values for drive in drives])
    table = FrameTable.concat(drive.table for drive in drives)
    spec = drives[0].spec
    learn_folder(ModelFolder(folder), values, table, spec, DictionarySetOptions(), ModelOptions())


class Proposer:
    """Proposes labels for drives, in a thread; `round` counts how often it did, and `proposals` is None before.

    `said`: what it does, or why it could not; `busy`: whether it does something.
    """

    def __init__(
        self, sequences: Sequence[FrameSequence], model: Path | None, network: Path | str | None = None
    ) -> None:
        self.busy, self.said, self.round = False, "", 0
        self.proposals: list[Proposal] | None = None
        self.model = model
        # Known before any work, and before the page is opened.
        words = DictionarySet.load(load_model(model).folder.words, network=network) if model else None
        self.spec = words.spec if words else DescriptorSpec(kind=DEFAULT_KIND)
        self.places = [*load_model(model).models] if model else []
        self._sequences = sequences
        self._described: dict[int, Descriptors] = {}
        self._lock = threading.Lock()

    def start(self, labels: Callable[[], Sequence[Sequence[str]]] | None = None) -> bool:
        """Propose by the model, or by one that is learned from `labels`, one list of places a drive; False if busy."""
        with self._lock:
            if self.busy:
                return False
            self.busy = True
        threading.Thread(target=self._run, args=(labels,), daemon=True, name="propose").start()
        return True

    def _run(self, labels: Callable[[], Sequence[Sequence[str]]] | None) -> None:
        try:
            if labels is not None:
                self._learned(labels())
            elif self.model is not None:
                self.proposals = [self._proposed(number, self.model) for number in range(len(self._sequences))]
                self.said = f"proposed by {self.model}"
            self.round += 1
        except PlacerecError as error:
            self.said = f"no proposals: {error}"
        except Exception as error:  # A thread that dies would tell nobody.
            log.error("proposing failed: %r", error)
            self.said = "no proposals: it failed, and the reason is where placerec was started"
        finally:
            self.busy = False

    def _learned(self, labels: Sequence[Sequence[str]]) -> None:
        drives = range(len(self._sequences))
        described = [self._frames_of(number) for number in drives]
        self.said = "learning from the labels"
        own = [self._own_labels(number, labels[number]) for number in drives]
        with tempfile.TemporaryDirectory(prefix="placerec-label-") as folder:
            learn_from(described, own, Path(folder))
            self.proposals = [self._proposed(number, Path(folder)) for number in drives]
        self.said = f"proposed by what {sum(map(any, own))} labelled drives teach"

    def _own_labels(self, number: int, places: Sequence[str]) -> list[str]:
        """The places of the frames that could be read."""
        known = dict(zip((frame.name for frame in self._sequences[number].frames), places, strict=True))
        return [known[name] for name in self._frames_of(number).frames]

    def _proposed(self, number: int, model: Path) -> Proposal:
        described = self._frames_of(number)
        return propose(described, [frame.name for frame in self._sequences[number].frames], model)

    def _frames_of(self, number: int) -> Descriptors:
        if number not in self._described:
            name, before = self._sequences[number].name, self.said

            def progress(done: int, total: int) -> None:
                self.said = f"looking at {name}: {done} of {total} frames"

            self._described[number] = describe([self._sequences[number]], self.spec, progress=progress)
            self.said = before
        return self._described[number]
