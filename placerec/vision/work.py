"""The work that is done on every frame, batch by batch: in several processes, and kept while it goes on."""

import io
import json
import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from placerec.arrays import Ints, Mask, Singles
from placerec.errors import SourceError, VisionError
from placerec.files import content_digest
from placerec.frames import Frame, Sequence as FrameSequence, read_gray
from placerec.frames.images import Batch, batches, content_key, with_images
from placerec.frames.sequence import Gray
from placerec.frames.table import FrameTable
from placerec.jobs import Executor, Progress, RemoteExecutor, workers
from placerec.journal import Journal
from placerec.version import __version__
from placerec.vision.images import check_gray, fit_image
from placerec.vision.spec import DescriptorSpec, describer, descriptor
from placerec.vision.storage import Arrays

log = logging.getLogger(__name__)


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
            raise VisionError(f"none of the {self.frames} images can be read; name a folder with images")
        constant = f"{self.constant} of one grey level throughout"
        log.info("%d frames described, %d skipped, %s", read, self.skipped, constant)


def describe_batch(spec: DescriptorSpec, batch: Batch) -> BatchResult:
    """The descriptors of a batch, `values` float32 (m, spec.length): a function of its arguments alone."""
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


def describe_frame(frame: Frame, image: Gray | str | None, spec: DescriptorSpec) -> Singles | str:
    """A frame's descriptor, or the reason why there is none; `image`: None if it is still in its file."""
    if isinstance(image, str):
        return image
    try:
        return descriptor(read_gray(frame.path) if image is None else image, spec)
    except SourceError as error:
        return str(error)
    except VisionError as error:
        return f"{frame.path}: {error}" if image is None else f"{frame.path}: frame {frame.name}: {error}"


def process_batches(
    function: Callable[[Batch], BatchResult],
    sequences: Sequence[FrameSequence],
    spec: DescriptorSpec,
    counts: FrameCounts,
    *,
    key: str = "describe",
    work: Executor | None = None,
    journal: Journal | None = None,
    progress: Progress | None = None,
) -> Iterator[tuple[FrameTable, Arrays]]:
    """Of every batch of the sequences, in order, the frames that have a row in what `function` finds, and the arrays.

    What could not be read is named in warnings and counted in `counts`. Raises VisionError if no image can be read, or
    if descriptors of the kind of `spec` are not made from images here.

    `key`: what the answers depend on besides the images; by it, `journal` gives back those of a run that was cut
    short, and keeps the others. `progress` is called with frames done and in all, 0 for a camera.
    """
    describer(spec)
    endless = any(sequence.recording is not None and sequence.recording.endless for sequence in sequences)
    # Ctrl-C ends what a camera records, and would end other processes.
    work = workers() if endless or work is None else work
    total = 0 if endless else sum(len(sequence.frames) for sequence in sequences)
    for batch, result in _found(function, sequences, spec, key, work, None if endless else journal):
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
        if progress is not None:
            progress(counts.frames, total)
        frames = [batch.frames[k] for k in result.kept.tolist()]
        yield FrameTable.of_frames(batch.sequence, frames), result.arrays
    counts.close()


def _found(
    function: Callable[[Batch], BatchResult],
    sequences: Sequence[FrameSequence],
    spec: DescriptorSpec,
    key: str,
    work: Executor,
    journal: Journal | None,
) -> Iterator[tuple[Batch, BatchResult]]:
    listed = batches(sequences)

    def key_of(sequence: FrameSequence, batch: Batch) -> bytes:
        return bytes.fromhex(content_digest(key, __version__, spec.as_dict(), content_key(sequence, batch)))

    ahead: list[tuple[FrameSequence, Batch]] = []
    if journal is not None:
        for sequence, batch in listed:
            data = journal.next(key_of(sequence, batch))
            if data is None:
                ahead = [(sequence, batch)]
                break
            yield batch, BatchResult.unpack(data)
    # What is handed out is remembered until its answer comes: frames and keys, not images.
    pending: deque[tuple[Batch, bytes]] = deque()

    def handed_out() -> Iterator[tuple[FrameSequence, Batch]]:
        for sequence, batch in chain(ahead, listed):
            pending.append((batch, key_of(sequence, batch) if journal is not None else b""))
            yield sequence, batch

    given = with_images(handed_out(), lambda image: _shrunk(image, spec))
    for result in work(function, map(_absolute, given) if isinstance(work, RemoteExecutor) else given):
        batch, key_of_batch = pending.popleft()
        if journal is not None:
            journal.add(key_of_batch, result.pack())
        yield batch, result


def _absolute(batch: Batch) -> Batch:
    """The batch for workers whose current folder is another."""
    return replace(batch, frames=tuple(replace(frame, path=frame.path.absolute()) for frame in batch.frames))


def _shrunk(image: Gray | str, spec: DescriptorSpec) -> Gray | str:
    """The image as it is fitted for its descriptor, which is the first that is done to it anyway."""
    if isinstance(image, str):
        return image
    try:
        return fit_image(check_gray(image), spec.image_size, spec.fit)
    except VisionError:
        return image  # and what describes it says why
