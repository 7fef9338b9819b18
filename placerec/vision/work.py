"""The work that is done on every frame, batch by batch: in several processes, and kept while it goes on."""

import io
import json
import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from placerec.arrays import Ints, Mask, Singles
from placerec.errors import SourceError, VisionError, counted
from placerec.files import content_digest
from placerec.frames import Frame, Sequence as FrameSequence
from placerec.frames.image import read_image
from placerec.frames.images import Batch, batches, content_key, with_images
from placerec.frames.sequence import Image
from placerec.frames.table import FrameTable
from placerec.jobs import Executor, Progress, RemoteExecutor, workers
from placerec.journal import Cache, Journal
from placerec.version import __version__
from placerec.vision.spec import DescriptorSpec, Fitted, check_describable, describe_parts, descriptor, fit_parts
from placerec.vision.storage import Arrays

log = logging.getLogger(__name__)
# Where descriptors are, in the folder that commands share.
DESCRIBED = "described"


@dataclass(frozen=True, eq=False)
class BatchResult:
    """What was found for a batch: `arrays`, a row for each frame in `kept` (indices in the batch).

    `blank`: which of these rows are of an image of one grey level throughout. `reasons`: why the other frames have
    none.
    """

    kept: Ints
    blank: Mask
    reasons: tuple[str, ...]
    arrays: Arrays

    def pack(self) -> bytes:
        """As bytes; `unpack` is the way back."""
        file = io.BytesIO()
        reasons = np.array(json.dumps(self.reasons))
        content: dict[str, Any] = {"kept": self.kept, "blank": self.blank, "reasons": reasons, **self.arrays}
        np.savez(file, **content)
        return file.getvalue()

    @classmethod
    def unpack(cls, data: bytes) -> "BatchResult":
        """What `pack` made; nothing in it is executed."""
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        return cls(arrays.pop("kept"), arrays.pop("blank"), tuple(json.loads(str(arrays.pop("reasons")))), arrays)


@dataclass
class FrameCounts:
    """How many frames there were so far, how many could not be read, and how many are of one grey level."""

    frames: int = 0
    skipped: int = 0
    constant: int = 0

    def close(self) -> None:
        """Say what came of it; VisionError if no image could be read."""
        read = self.frames - self.skipped
        if not read:
            raise VisionError(f"none of the {counted(self.frames, 'image')} can be read; name a folder with images")
        skipped = f", {self.skipped} skipped" if self.skipped else ""
        constant = f", {self.constant} of one grey level throughout" if self.constant else ""
        log.info("%s described%s%s", counted(read, "frame"), skipped, constant)


def describe_batch(spec: DescriptorSpec, batch: Batch) -> BatchResult:
    """The descriptors of a batch, `values` float32 (m, spec.length): a function of its arguments alone."""
    if batch.known is not None:
        return BatchResult.unpack(batch.known)
    rows, kept, reasons = [], [], []
    images = batch.images or (None,) * len(batch.frames)
    for k, (frame, image) in enumerate(zip(batch.frames, images, strict=True)):
        found = describe_frame(frame, image, spec)
        if isinstance(found, str):
            reasons.append(found)
        else:
            rows.append(found)
            kept.append(k)
    values = np.array(rows, np.float32).reshape(len(rows), spec.length)
    blank = np.logical_not(values.any(axis=1))
    return BatchResult(np.array(kept, np.int64), np.asarray(blank), tuple(reasons), {"values": values})


def describe_frame(frame: Frame, image: Fitted | Image | str | None, spec: DescriptorSpec) -> Singles | str:
    """A frame's descriptor, or the reason why there is none; `image`: perhaps fitted, None if still in its file."""
    if isinstance(image, str):
        return image
    try:
        if isinstance(image, tuple):
            return describe_parts(image, spec)
        return descriptor(read_image(frame.path, colours=spec.colours) if image is None else image, spec)
    except SourceError as error:
        return str(error)
    except VisionError as error:
        return f"{frame.path}: {error}" if image is None else f"{frame.path}: frame {frame.name}: {error}"


def process_batches(
    sequences: Sequence[FrameSequence],
    spec: DescriptorSpec,
    counts: FrameCounts,
    *,
    then: Callable[[Singles], Arrays] | None = None,
    key: str = "describe",
    work: Executor | None = None,
    journal: Journal | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> Iterator[tuple[FrameTable, Arrays]]:
    """Of every batch of the sequences, in order, the frames that can be read, and arrays with a row for each of them.

    What could not be read is named in warnings and counted in `counts`. Raises VisionError if no image can be read, or
    if descriptors of the kind of `spec` are not made from images here.

    `then`: makes the arrays from the descriptors (m, spec.length), where the work is done; None for `values`, these
    descriptors. `key`: what the arrays depend on besides the descriptors; by it, `journal` gives back those of a run
    that was cut short, and keeps the others. `cache`: the folder where descriptors are kept for other runs, and taken
    from. `progress` is called with frames done and in all, 0 for a camera.
    """
    check_describable(spec)
    endless = any(sequence.recording is not None and sequence.recording.endless for sequence in sequences)
    # Ctrl-C ends what a camera records, and would end other processes.
    work = workers() if endless or work is None else work
    kept = None if endless or cache is None else Cache(Path(cache) / DESCRIBED)
    total = 0 if endless else sum(len(sequence.frames) for sequence in sequences)
    known = 0
    step = _Step(spec, then, kept is not None)
    for batch, result in _found(step, sequences, key, work, None if endless else journal, kept):
        for reason in result.reasons:
            log.warning("%s; the frame is skipped", reason)
        blank = result.kept[result.blank].tolist()
        if blank and not counts.constant:
            frame = batch.frames[blank[0]]
            where = frame.path if frame.path.name == frame.name else f"{frame.path}: frame {frame.name}"
            log.warning("%s: of one grey level throughout; its descriptor is zero", where)
        counts.frames += len(batch.frames)
        counts.skipped += len(result.reasons)
        counts.constant += len(blank)
        known += len(batch.frames) if batch.known is not None else 0
        if progress is not None:
            progress(counts.frames, total)
        frames = [batch.frames[k] for k in result.kept.tolist()]
        yield FrameTable.of_frames(batch.sequence, frames), result.arrays
    if known:
        log.info("%d of %d frames were described before: %s", known, counts.frames, cache)
    counts.close()


@dataclass(frozen=True)
class _Step:
    """What is done with a batch, in a worker: its descriptors, and what `then` makes of them.

    `keeping`: new descriptors are among the arrays, as `values`, to be kept.
    """

    spec: DescriptorSpec
    then: Callable[[Singles], Arrays] | None
    keeping: bool

    def __call__(self, batch: Batch) -> BatchResult:
        """A function of the batch alone."""
        found = describe_batch(self.spec, batch)
        if self.then is None:
            return found
        new = found.arrays if self.keeping and batch.known is None else {}
        return replace(found, arrays=self.then(found.arrays["values"]) | new)


def _found(
    step: _Step,
    sequences: Sequence[FrameSequence],
    key: str,
    work: Executor,
    journal: Journal | None,
    cache: Cache | None,
) -> Iterator[tuple[Batch, BatchResult]]:
    listed = batches(sequences, colours=step.spec.colours)

    def key_of(what: str, sequence: FrameSequence, batch: Batch) -> bytes:
        return bytes.fromhex(content_digest(what, __version__, step.spec.as_dict(), content_key(sequence, batch)))

    ahead: list[tuple[FrameSequence, Batch]] = []
    if journal is not None:
        for sequence, batch in listed:
            data = journal.next(key_of(key, sequence, batch))
            if data is None:
                ahead = [(sequence, batch)]
                break
            yield batch, BatchResult.unpack(data)
    # What is handed out is remembered until its answer comes: frames and keys, not images.
    pending: deque[tuple[Batch, bytes, bytes]] = deque()

    def handed_out() -> Iterator[tuple[FrameSequence, Batch]]:
        for sequence, batch in chain(ahead, listed):
            kept_as = key_of("descriptors", sequence, batch) if cache is not None else b""
            known = cache.get(kept_as) if cache is not None else None
            shown = batch if known is None else replace(batch, known=b"")
            pending.append((shown, key_of(key, sequence, batch) if journal is not None else b"", kept_as))
            yield sequence, batch if known is None else replace(batch, known=known)

    given = with_images(handed_out(), lambda image: _shrunk(image, step.spec), colours=step.spec.colours)
    for result in work(step, map(_absolute, given) if isinstance(work, RemoteExecutor) else given):
        batch, key_of_batch, kept_as = pending.popleft()
        # What could not be read is tried again by the next run.
        if cache is not None and batch.known is None and not result.reasons:
            cache.put(kept_as, replace(result, arrays={"values": result.arrays["values"]}).pack())
        if step.then is not None and step.keeping:
            result.arrays.pop("values", None)
        if journal is not None:
            journal.add(key_of_batch, result.pack())
        yield batch, result


def _absolute(batch: Batch) -> Batch:
    """The batch for workers whose current folder is another."""
    return replace(batch, frames=tuple(replace(frame, path=frame.path.absolute()) for frame in batch.frames))


def _shrunk(image: Image | str, spec: DescriptorSpec) -> Fitted | Image | str:
    """The image as it is fitted for its descriptors, which is the first that is done to it anyway."""
    if isinstance(image, str):
        return image
    try:
        return fit_parts(image, spec)
    except VisionError:
        return image  # and what describes it says why
