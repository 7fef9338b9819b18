"""Single frames for people to look at: the right one, in colours, without what comes before it."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.recordings import (
    START,
    STEP,
    Picture,
    find_one,
    jpeg,
    pictures,
    raw,
    scheduled_as_before,
    write_bag,
    write_video,
)
from test_video import KINDS

from placerec.frames import Sequence, find_sequences
from placerec.frames.images import picture_at
from placerec.frames.sequence import Gray


def looked_at(sequence: Sequence, indices: list[int], height: int = 48) -> list[Gray]:
    found = [picture_at(sequence, index, height) for index in indices]
    assert not [reason for reason in found if isinstance(reason, str)]
    return [picture for picture in found if not isinstance(picture, str)]


def as_gray(picture: Picture) -> Picture:
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)


def all_colours(path: Path) -> list[Picture]:
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    found: list[Picture] = []
    while True:
        decoded, picture = capture.read()
        if not decoded:
            return found
        found.append(np.asarray(picture, np.uint8))


@pytest.mark.parametrize(("name", "codec"), KINDS)
def test_a_frame_of_a_video_is_the_one_that_is_listed(tmp_path: Path, name: str, codec: str) -> None:
    path = write_video(tmp_path / name, codec)
    whole = all_colours(path)
    assert len(whole) == 20

    def equal(found: list[Gray], frames: list[int]) -> bool:
        expected = [whole[i] if one.ndim == 3 else as_gray(whole[i]) for one, i in zip(found, frames, strict=True)]
        return all(map(np.array_equal, found, expected))

    order = [13, 2, 19, 0, 7]
    assert equal(looked_at(find_one(path), order), order)
    assert equal(looked_at(find_one(path, every=3), [4, 1]), [12, 3])
    assert equal(looked_at(find_one(path, begin=0.5), [0, 9]), [5, 14])
    # In MPEG-2 a seek does not lead to every frame; then it is the one that is decoded from the start, in grey.
    assert codec == "MPG2" or all(one.ndim == 3 for one in looked_at(find_one(path), order))


def test_a_frame_late_in_a_long_video_costs_no_pass_over_it(tmp_path: Path) -> None:
    frames = pictures(100) * 60
    sequence = find_one(write_video(tmp_path / "long.mp4", "mp4v", frames, rate=30))
    assert sequence.recording is not None
    begun = time.process_time()
    (late,) = looked_at(sequence, [5990])
    seek = time.process_time() - begun
    begun = time.process_time()
    next(iter(sequence.recording.frames(5990)))
    assert seek < (time.process_time() - begun) / 3
    gray = as_gray(late.astype(np.uint8))
    assert np.abs(gray.astype(int) - as_gray(frames[5990])).mean() < 8


def test_a_frame_of_a_video_that_only_pyav_decodes(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    path = tmp_path / "run.mp4"
    with scheduled_as_before():
        try:
            container = av.open(str(path), "w")
            stream = container.add_stream("libsvtav1", rate=10, options={"svtav1-params": "lp=1"})
        except (av.FFmpegError, ValueError) as error:
            pytest.skip(f"no encoder of AV1 here: {error}")
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        for shown in pictures(height=64):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(shown, format="bgr24")))
        container.mux(stream.encode(None))
        container.close()
    sequence = find_one(path)
    for index in (12, 3, 19):
        (picture,) = looked_at(sequence, [index], 64)
        assert picture.shape == (64, 64, 3)
        assert np.abs(picture.astype(int) - pictures(height=64)[index]).mean() < 12


@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
@pytest.mark.parametrize("encoding", ["bgr8", "mono8"])
def test_a_frame_of_a_bag_is_in_the_colours_that_it_has(tmp_path: Path, storage: str, encoding: str) -> None:
    shown = pictures(6) if encoding == "bgr8" else [as_gray(one) for one in pictures(6)]
    # Stored in another order than that of the stamps, two of them at once.
    messages = [raw(shown[i], encoding, START + i * STEP) for i in (0, 2, 1, 3, 5, 4)]
    for message, stored in zip(messages, (0, 1, 1, 2, 3, 4), strict=True):
        message.stored = START + stored * STEP
    sequence = find_one(write_bag(tmp_path / ("run.bag" if storage == "ros1" else "run"), {"/c": messages}, storage))
    found = looked_at(sequence, [4, 1, 2, 0])
    expected = [shown[i] if encoding == "bgr8" else np.dstack([shown[i]] * 3) for i in (4, 1, 2, 0)]
    assert all(map(np.array_equal, found, expected))


def test_files_are_read_in_colours_and_made_smaller(tmp_path: Path) -> None:
    (picture,) = pictures(1, 800, 1000)
    (tmp_path / "a.jpg").write_bytes(jpeg(picture))
    cv2.imwrite(str(tmp_path / "b.png"), picture)
    (tmp_path / "c.jpg").write_bytes(b"no picture")
    cv2.imwrite(str(tmp_path / "d.png"), picture[:, :, 0].astype(np.uint16) * 257)
    (sequence,) = find_sequences([tmp_path])
    small = np.asarray(cv2.resize(picture, (125, 100), interpolation=cv2.INTER_AREA), int)
    for one in looked_at(sequence, [0, 1], 100):
        assert one.shape == (100, 125, 3)
        assert np.abs(one.astype(int) - small).mean() < 3
    assert picture_at(sequence, 2, 100) == f"{tmp_path / 'c.jpg'}: is no image that OpenCV can decode; " + (
        "copy it again or remove it"
    )
    (deep,) = looked_at(sequence, [3], 100)
    assert np.abs(deep[:, :, 0].astype(int) - small[:, :, 0]).mean() < 3
