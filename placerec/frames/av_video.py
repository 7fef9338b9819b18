"""Videos that OpenCV's wheel cannot decode (AV1), and videos in pieces, as cameras send them, through PyAV.

Frames are decoded by one thread, and turned and made grey as OpenCV's are, or left in their colours.
"""

from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from placerec.errors import SourceError
from placerec.frames.image import as_gray, as_image
from placerec.frames.sequence import Frame, Gray, Image, shown_pixels
from placerec.frames.video import SAME, Video

# Of a frame that was decoded, given its name, and whether colours are wanted: the image, or why there is none.
Decoded = Callable[[str, bool], Image | str]


@dataclass(frozen=True)
class AvVideo(Video):
    """A `Video` that is decoded by PyAV."""

    def frames(self, first: int = 0, *, colours: bool = False) -> Iterator[tuple[Frame, Image | str]]:
        for position, decoded in _decoded(self.path, self.times):
            index, between = divmod(position - self.start, self.every)
            if between or index < first:
                continue
            if index >= len(self.listed):
                return
            yield self.listed[index], decoded(f"{self.path}: frame {self.listed[index].name}", colours)

    def picture(self, index: int) -> Gray | str:
        """The frame at `index` for people to look at, (h, w, 3), or why there is none."""
        import av

        seconds = self.times[self.start + index * self.every]
        with av.open(str(self.path.absolute())) as container:
            stream = container.streams.video[0]
            if stream.time_base is not None:
                container.seek(round(seconds / stream.time_base) + (stream.start_time or 0), stream=stream)
                for frame in _frames(container):
                    found = float((frame.pts - (stream.start_time or 0)) * stream.time_base)
                    if abs(found - seconds) <= SAME:
                        return as_gray(_colours(frame), f"{self.path}: frame {self.listed[index].name}")
                    if found > seconds:
                        break
        return next(shown_pixels(image) for _, image in self.frames(index, colours=True))


def can_decode(path: Path) -> bool:
    """Whether PyAV decodes a frame of a video."""
    import av

    try:
        with av.open(str(path.absolute())) as container:
            return next(_frames(container), None) is not None
    except av.FFmpegError:
        return False


def decode_pieces(codec: str, pieces: Iterable[bytes]) -> Iterator[tuple[int, Decoded]]:
    """The frames of a stream that comes in pieces, a frame each, with the numbers of their pieces, none left out."""
    import av

    # FFmpeg's own decoder of AV1 works with graphics cards alone.
    context: Any = av.CodecContext.create("libdav1d" if codec == "av1" else codec, "r")
    context.thread_count = 1
    done = count = 0

    def decode(packet: Any) -> Iterator[tuple[int, Decoded]]:
        nonlocal done
        try:
            frames = context.decode(packet)
        except av.FFmpegError:
            return
        for frame in frames:
            if frame.pts is not None and done <= frame.pts:
                yield from ((lost, _no_frame) for lost in range(done, frame.pts))
                yield frame.pts, partial(_image, frame)
                done = frame.pts + 1

    for number, piece in enumerate(pieces):
        count = number + 1
        # To a decoder an empty one is the end.
        if piece:
            packet = av.Packet(piece)
            packet.pts = number
            yield from decode(packet)
    yield from decode(None)
    yield from ((lost, _no_frame) for lost in range(done, count))


def _decoded(path: Path, times: "array[float]") -> Iterator[tuple[int, Decoded]]:
    """Every frame of these times in order, with its number."""
    import av

    done = 0
    with av.open(str(path.absolute())) as container:
        stream = container.streams.video[0]
        for frame in _frames(container):
            seconds = float((frame.pts - (stream.start_time or 0)) * stream.time_base)
            found = bisect_left(times, seconds - SAME)
            if done <= found < len(times) and times[found] - seconds <= SAME:
                yield from ((lost, _no_frame) for lost in range(done, found))
                yield found, partial(_image, frame)
                done = found + 1
    yield from ((lost, _no_frame) for lost in range(done, len(times)))


def _frames(container: Any) -> Iterator[Any]:
    """The frames that can be decoded and have a time."""
    import av

    stream = container.streams.video[0]
    stream.codec_context.thread_count = 1
    for packet in container.demux(stream):
        try:
            frames = packet.decode()
        except av.FFmpegError:
            continue
        yield from (frame for frame in frames if frame.pts is not None)


def _image(frame: Any, name: str, colours: bool) -> Image | str:
    try:
        return as_image(_colours(frame), name, colours=colours)
    except SourceError as error:
        return str(error)


def _colours(frame: Any) -> Any:
    import numpy as np

    return np.ascontiguousarray(np.rot90(frame.to_ndarray(format="bgr24"), round(frame.rotation / 90)))


def _no_frame(name: str, colours: bool) -> str:
    return f"{name} cannot be decoded"
