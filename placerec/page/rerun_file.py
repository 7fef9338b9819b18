"""Beliefs as a recording of Rerun (rerun.io): frames, beliefs, words and places as series over time, in one .rrd file.

Of each drive, below its name: `frame` (the pictures), `belief/PLACE` and `unknown` (numbers from 0 to 1), `word`, and
`true` and `decided` (texts, where the place changes). Timelines: `frame`, its number, and `time`, seconds from the
first frame, where frames have times.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import SourceError
from placerec.figures.canvas import place_colours
from placerec.files import whole_file
from placerec.frames import Sequence as FrameSequence
from placerec.frames.images import picture_at
from placerec.hohmm.beliefs import UNKNOWN_PLACE, Beliefs
from placerec.jobs import Progress

# The most pixels of height, and JPEG's quality.
_HEIGHT, _QUALITY = 480, 85


def write_rerun(
    path: Path | str,
    beliefs: Sequence[Beliefs],
    sequences: Iterable[FrameSequence] = (),
    progress: Progress | None = None,
) -> None:
    """Write a recording of some drives; `sequences`: their images, those of each called as its beliefs are.

    Needs rerun-sdk, which whoever calls this has asked for (`check_optional`). Raises OutputError for a path that
    cannot be written. The identifiers and times in such a file are of the moment: no two have the same bytes.
    """
    import rerun

    of = {sequence.name: sequence for sequence in sequences}
    pictured = [one for one in beliefs if one.name in of]
    total, done = sum(len(one) for one in pictured), 0
    with whole_file(Path(path)) as partial:
        recording = rerun.RecordingStream("placerec")
        try:
            recording.save(partial)
            for one in beliefs:
                _send_numbers(rerun, recording, one)
                _send_texts(rerun, recording, one)
            for one in pictured:
                for _ in _send_pictures(rerun, recording, one, of[one.name]):
                    done += 1
                    if progress:
                        progress(done, total)
            recording.flush()
        finally:
            recording.disconnect()


def _send_numbers(rerun: Any, recording: Any, beliefs: Beliefs) -> None:
    series: Mapping[tuple[str, ...], Floats] = {
        ("belief", place): beliefs.belief[:, column] for column, place in enumerate(beliefs.places)
    } | ({} if beliefs.unknown is None else {(UNKNOWN_PLACE,): beliefs.unknown})
    names = [path[-1] for path in series]
    rows = np.arange(len(beliefs))
    for (path, values), colour in zip(series.items(), place_colours(names), strict=True):
        entity = rerun.new_entity_path([beliefs.name, *path])
        paint = [*np.rint(255 * colour).astype(int).tolist(), 255]
        recording.log(entity, rerun.SeriesLines(colors=[paint], names=[path[-1]]), static=True)
        times = _indexes(rerun, beliefs, rows)
        recording.send_columns(entity, indexes=times, columns=rerun.Scalars.columns(scalars=values))


def _send_texts(rerun: Any, recording: Any, beliefs: Beliefs) -> None:
    for name, texts, rows in (
        ("word", beliefs.words, np.flatnonzero([bool(word) for word in beliefs.words])),
        ("true", beliefs.truth, _changes(beliefs.truth)),
        ("decided", beliefs.best, _changes(beliefs.best)),
    ):
        if len(rows):
            shown = [texts[row] or "(no label)" for row in rows.tolist()]
            recording.send_columns(
                rerun.new_entity_path([beliefs.name, name]),
                indexes=_indexes(rerun, beliefs, rows),
                columns=rerun.TextLog.columns(text=shown),
            )


def _send_pictures(rerun: Any, recording: Any, beliefs: Beliefs, sequence: FrameSequence) -> Iterable[int]:
    """The frames, one after the other; those that cannot be read are left out."""
    import cv2

    entity = rerun.new_entity_path([beliefs.name, "frame"])
    number = {frame.name: index for index, frame in enumerate(sequence.frames)}
    for row, frame in enumerate(beliefs.frames):
        image = picture_at(sequence, number[frame], _HEIGHT)
        if not isinstance(image, str):
            written, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
            if not written:
                raise SourceError(f"{sequence.source}: OpenCV cannot write frame {frame} as JPEG")
            recording.send_columns(
                entity,
                indexes=_indexes(rerun, beliefs, np.array([row])),
                columns=rerun.EncodedImage.columns(blob=[data.tobytes()], media_type=["image/jpeg"]),
            )
        yield row


def _indexes(rerun: Any, beliefs: Beliefs, rows: Ints) -> list[Any]:
    """Where some rows lie on the timelines."""
    found = [rerun.TimeColumn("frame", sequence=rows)]
    if len(beliefs) and np.isfinite(beliefs.times).all():
        found.append(rerun.TimeColumn("time", duration=beliefs.times[rows] - beliefs.times[0]))
    return found


def _changes(texts: Sequence[str]) -> Ints:
    """The rows at which a text differs from the one before."""
    changed = [True, *(one != other for one, other in pairwise(texts))] if texts else []
    return np.flatnonzero(changed)
