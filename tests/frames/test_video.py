"""Videos: what is listed is what is read, and both are what decoding the whole file gives."""

import logging
import math
import pickle
import struct
import subprocess
import sys
from array import array
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.recordings import cut, decoded, find_one, grays_of, pictures, read_images, scheduled_as_before, write_video
from numpy.typing import NDArray

from placerec.errors import SourceError
from placerec.frames import Frame, SourceOptions, find_sequences, images_at
from placerec.frames.sequence import Gray
from placerec.frames.video import SUFFIXES, Video, _decoded, _increasing, _walked, list_times

# A container and a codec; MPEG-2 is written with B-frames, whose order in the file is not that in time.
KINDS = [
    ("run.mp4", "mp4v"),
    ("run.m4v", "mp4v"),
    ("run.mov", "mp4v"),
    ("run.avi", "MJPG"),
    ("run.avi", "XVID"),
    ("run.mkv", "FFV1"),
    ("run.webm", "VP80"),
    ("run.wmv", "WMV2"),
    ("run.mp4", "MPG2"),
    ("run.mkv", "MPG2"),
    ("run.avi", "MPG2"),
    ("run.mpg", "MPG2"),
    ("run.ts", "MPG2"),
    ("run.m2ts", "MPG2"),
]


def equal(one: list[Gray | str], other: list[NDArray[np.uint8]]) -> bool:
    return len(one) == len(other) and all(map(np.array_equal, one, other))


@pytest.mark.parametrize(("name", "codec"), KINDS)
def test_frames_are_those_that_decoding_gives(tmp_path: Path, name: str, codec: str) -> None:
    path = write_video(tmp_path / name, codec)
    sequence = find_one(path)
    assert (sequence.name, sequence.source) == ("run", path)
    assert [frame.name for frame in sequence.frames] == [f"{i:06d}" for i in range(20)]
    assert np.allclose([frame.time for frame in sequence.frames], np.arange(20) / 10, atol=1e-6)
    assert {(frame.place, frame.path) for frame in sequence.frames} == {("", path)}
    whole = decoded(path)
    assert equal(read_images(sequence), whole)
    # Skipping and starting late change nothing of what is read.
    for every in (3, 19, 20):
        some = find_one(path, every=every)
        assert some.frames == sequence.frames[::every]
        assert equal(read_images(some), whole[::every])
        assert equal(read_images(some, 1), whole[every::every])
    assert equal(read_images(sequence, 7), whole[7:])
    assert read_images(sequence, 20) == read_images(sequence, 25) == []


def test_levels_are_close_to_those_that_were_written(tmp_path: Path) -> None:
    written = [cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) for picture in pictures()]
    off = [
        np.abs(np.subtract(a, b, dtype=np.int16)).max()
        for a, b in zip(read_images(find_one(write_video(tmp_path / "run.mkv", "FFV1"))), written, strict=True)
        if not isinstance(a, str)
    ]
    assert len(off) == 20
    assert max(off) <= 3


def test_a_recording_can_be_sent_to_another_process_and_tells_what_it_reads(tmp_path: Path) -> None:
    path = write_video(tmp_path / "run.mp4")
    sequence = find_one(path, every=4)
    assert repr(sequence.recording) == f"Video(path={path!r}, every=4)"
    again = pickle.loads(pickle.dumps(sequence))  # noqa: S301
    assert again == sequence
    assert equal(read_images(again), decoded(path)[::4])
    assert again.recording.files() == [path]
    assert not again.recording.endless


def test_the_images_of_some_frames(tmp_path: Path) -> None:
    path = write_video(tmp_path / "run.mp4")
    sequence, whole = find_one(path), decoded(path)
    assert equal(grays_of(images_at(sequence, [2, 3, 11, 19])), [whole[i] for i in (2, 3, 11, 19)])
    assert list(images_at(sequence, [])) == []


@pytest.mark.parametrize(("name", "codec"), [("run.avi", "MJPG"), ("run.avi", "XVID"), ("run.webm", "VP80")])
def test_a_truncated_video_gives_what_it_has(
    tmp_path: Path, name: str, codec: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = cut(write_video(tmp_path / name, codec, pictures(60)), 0.7, f"short{Path(name).suffix}")
    sequence = find_one(path)
    assert 20 < len(sequence.frames) < 50
    assert equal(read_images(sequence), decoded(path))
    (said,) = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert said.startswith(f"{path}: is truncated or damaged: {len(sequence.frames)} frames up to second ")
    assert said.endswith("are there, of about 60 up to second 6.0")


def test_a_frame_that_cannot_be_decoded_is_named_and_the_rest_is_read(tmp_path: Path) -> None:
    path = write_video(tmp_path / "run.mp4", frames=pictures(60))
    good = decoded(path)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 400] = b"\xff" * 400
    path.write_bytes(bytes(data))
    sequence = find_one(path)
    grays = read_images(sequence)
    assert len(sequence.frames) == len(grays) == 60
    bad = [(frame.name, gray) for frame, gray in zip(sequence.frames, grays, strict=True) if isinstance(gray, str)]
    assert 0 < len(bad) < 10
    assert all(gray == f"{path}: frame {name} cannot be decoded" for name, gray in bad)
    # What lies before the damage and behind the next whole picture is what it was, under the number that it had.
    first = int(bad[0][0])
    assert equal(grays[: first - 2], good[: first - 2])
    assert np.array_equal(grays[59], good[59])


def test_times_that_vary(tmp_path: Path) -> None:
    """The table of durations in an MP4 (stts) is written anew: 0.1 s a frame for ten frames, then 0.3 s."""
    path = write_video(tmp_path / "run.mp4")
    data = path.read_bytes()
    place = data.index(b"stts")
    entries, count, delta = struct.unpack_from(">III", data, place + 8)
    assert (entries, count) == (1, 20)
    # A table of two entries needs eight bytes more: the box goes to the end of those that hold it by another offset.
    old = data[place - 4 : place + 20]
    new = struct.pack(">I4sIIIIII", 32, b"stts", 0, 2, 10, delta, 10, 3 * delta)
    changed = data.replace(old, new)
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        at = changed.index(box) - 4
        changed = changed[:at] + struct.pack(">I", struct.unpack_from(">I", changed, at)[0] + 8) + changed[at + 4 :]
    # The header's duration is 2 s, and an edit list would cut the rest off: it is made a box of no meaning.
    path.write_bytes(changed.replace(b"edts", b"free"))
    sequence = find_one(path)
    expected = [*np.arange(10) / 10, *(1 + 0.3 * np.arange(10))]
    assert np.allclose([frame.time for frame in sequence.frames], expected, atol=1e-5)
    assert equal(read_images(sequence), decoded(path))


def test_a_rotated_video_is_turned(tmp_path: Path) -> None:
    """The matrix in an MP4's track header says that the picture is to be turned by 90 degrees."""
    path = write_video(tmp_path / "run.mp4", "mp4v")
    upright = read_images(find_one(path))
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 4 + 40
    struct.pack_into(">9i", data, matrix, 0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30)
    path.write_bytes(bytes(data))
    turned = read_images(find_one(path))
    assert equal(turned, [np.rot90(gray, -1) for gray in upright if not isinstance(gray, str)])


def test_what_is_no_video(tmp_path: Path) -> None:
    def failure(path: Path) -> str:
        with pytest.raises(SourceError) as error:
            find_sequences([path])
        return str(error.value)

    (tmp_path / "empty.mp4").touch()
    assert failure(tmp_path / "empty.mp4") == f"{tmp_path / 'empty.mp4'}: is empty; copy it again or remove it"
    text = tmp_path / "text.mp4"
    text.write_text("this is a text\n" * 100)
    lost = "is no video that OpenCV can read, or has lost its index; remove it"
    assert failure(text) == f"{text}: {lost}"
    # An MP4's index stands at its end: without it nothing can be found.
    short = cut(write_video(tmp_path / "run.mp4"), 0.6, "short.mp4")
    assert failure(short) == f"{short}: {lost}"
    assert failure(tmp_path / "none.mp4") == f"{tmp_path / 'none.mp4'}: no such file or folder"
    (tmp_path / "folder.mp4").mkdir()
    assert "no sequence there" in failure(tmp_path / "folder.mp4")
    spoilt = write_video(tmp_path / "spoilt.mp4")
    data = spoilt.read_bytes()
    start, end = data.index(b"mdat") + 4, data.index(b"moov") - 4
    spoilt.write_bytes(data[:start] + b"\xff" * (end - start) + data[end:])
    assert failure(spoilt) == f"{spoilt}: OpenCV can decode no frame of it (codec FMP4); convert it to H.264"


def test_a_video_too_small_to_be_described_says_so_of_every_frame(tmp_path: Path) -> None:
    path = write_video(tmp_path / "run.avi", "MJPG", frames=pictures(3, 6, 16))
    grays = read_images(find_one(path))
    assert grays[0] == f"{path}: frame 000000: is 16x6 pixels, and 8 a side are needed; remove it"


def test_nothing_is_written_to_stderr_but_what_is_said_here(tmp_path: Path) -> None:
    """FFmpeg and OpenCV write to the file descriptor: a process of its own is asked."""
    write_video(tmp_path / "run.avi", "XVID", pictures(60))
    for share, name in ((0.8, "short.avi"), (0.6, "shorter.avi")):
        cut(tmp_path / "run.avi", share, name)
    data = bytearray((tmp_path / "run.avi").read_bytes())
    data[len(data) // 2 : len(data) // 2 + 300] = b"\xff" * 300
    (tmp_path / "damaged.avi").write_bytes(bytes(data))
    (tmp_path / "text.mp4").write_text("no video")
    program = (
        "import sys\nfrom placerec.frames import find_sequences\nfrom placerec.errors import SourceError\n"
        "import logging; logging.disable()\n"
        "for path in sys.argv[1:]:\n"
        "    try:\n        print(len(list(find_sequences([path])[0].recording.frames())))\n"
        "    except SourceError as error:\n        print('no')\n"
    )
    paths = sorted(map(str, tmp_path.iterdir()))
    ran = subprocess.run([sys.executable, "-c", program, *paths], capture_output=True, text=True, check=True)
    assert ran.stderr == ""
    assert [line == "no" for line in ran.stdout.split()] == [False, False, False, False, True]


def test_a_folder_of_videos_is_a_folder_of_sequences(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for name in ("run10.mp4", "run2.avi", "b/run1.MP4"):
        write_video(tmp_path / name, "mp4v" if name.lower().endswith("mp4") else "MJPG", pictures(3))
    write_images = tmp_path / "run3/std_cam"
    write_images.mkdir(parents=True)
    (write_images / "t1.000000.jpeg").touch()
    (tmp_path / "cover.jpg").touch()
    (tmp_path / ".hidden.mp4").touch()
    assert [sequence.name for sequence in find_sequences([tmp_path])] == ["run1", "run2", "run3", "run10"]
    assert f"{tmp_path}: holds sequences; 1 image beside them not read" in caplog.messages
    (tmp_path / "b/run2.mkv").write_bytes((tmp_path / "run2.avi").read_bytes())
    names = [sequence.name for sequence in find_sequences([tmp_path])]
    assert names == ["run1", "b-run2", f"{tmp_path.name}-run2", "run3", "run10"]
    with pytest.raises(SourceError, match=r"run2\.avi: is given twice"):
        find_sequences([tmp_path / "run2.avi", tmp_path])


def test_a_video_beside_stamped_images_is_not_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_video(tmp_path / "run/preview.mp4", frames=pictures(3))
    (tmp_path / "run/t1.500000.jpeg").touch()
    (sequence,) = find_sequences([tmp_path])
    assert [frame.name for frame in sequence.frames] == ["t1.500000.jpeg"]
    assert f"{tmp_path / 'run'}: its images are read, and not preview.mp4 beside them" in caplog.messages


def test_every_holds_for_images_too(tmp_path: Path) -> None:
    for i in range(10):
        (tmp_path / f"{i}.png").touch()
    (sequence,) = find_sequences([tmp_path], options=SourceOptions(every=4))
    assert [frame.name for frame in sequence.frames] == ["0.png", "4.png", "8.png"]
    assert [type(frame) for frame in sequence.frames] == [Frame] * 3
    assert math.isnan(sequence.frames[0].time)
    with pytest.raises(SourceError, match="every 0 frames is not possible"):
        SourceOptions(every=0)


def test_names_with_signs_of_ffmpeg_are_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_video(tmp_path / "run.avi", "MJPG", pictures(3))
    monkeypatch.chdir(tmp_path)
    for name in ("a:b.avi", "%03d.avi", "concat:x.avi", "-.avi", "ü ñ.avi"):
        Path(name).write_bytes((tmp_path / "run.avi").read_bytes())
        assert len(list_times(Path(name))) == 3
        assert Path(name).suffix in SUFFIXES


class Scripted:
    """A capture that gives these times in seconds, None where a packet cannot be read; then nothing."""

    def __init__(self, *times: float | None) -> None:
        self.times, self.now = list(times), 0.0

    def grab(self) -> bool:
        found = self.times.pop(0) if self.times else None
        self.now = 0.0 if found is None else found
        return found is not None

    def get(self, prop: int) -> float:
        return 1000 * self.now


def positions(listed: list[float], *given: float | None, late: bool = False) -> list[tuple[int, bool]]:
    return list(_decoded(Scripted(*given), array("d", listed), late=late))


def test_decoded_frames_are_found_again_by_their_times(caplog: pytest.LogCaptureFixture) -> None:
    listed = [0.0, 0.1, 0.2, 0.3]
    read = [(0, True), (1, True), (2, True), (3, True)]
    assert positions(listed, 0.0, 0.1, 0.2, 0.3) == read
    # The last B-frame of MPEG files has the time 0; AVI's times are all late by a frame or two.
    assert positions(listed, 0.0, 0.1, 0.2, 0.0) == read
    assert positions(listed, 0.2, 0.3, 0.4, 0.0, late=True) == read
    # Damaged packets: told of by the decoder, or left out in silence; at the start, and at the end.
    assert positions(listed, 0.0, None, 0.2, 0.3) == [(0, True), (1, False), (2, True), (3, True)]
    assert positions(listed, 0.2, 0.3) == [(0, False), (1, False), (2, True), (3, True)]
    assert positions(listed, 0.0, 0.1) == [(0, True), (1, True), (2, False), (3, False)]
    assert positions(listed) == [(0, False), (1, False), (2, False), (3, False)]
    # A frame whose packet could not be walked is none of those that are listed.
    assert positions(listed, 0.0, 0.05, 0.1, 0.15, None, 0.2, 0.3, 0.4) == read
    caplog.clear()
    assert list(_walked(Path("x.mp4"), Scripted(0.0, None, None, 0.1))) == [0.0, 0.1]
    assert caplog.messages == ["x.mp4: is damaged: 2 packets are passed over"]
    assert _increasing([0.0, 0.1, 0.1, 0.3, 0.0], 0.1).tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]


def test_what_may_be_something_else_is_known_by_content(tmp_path: Path) -> None:
    write_video(tmp_path / "runs/a.ts", "MPG2", pictures(3))
    (tmp_path / "runs/code.ts").write_text("export const video = false;\n" * 50)
    (tmp_path / "runs/b.h264").write_text("H.264 is described here.")
    assert [sequence.name for sequence in find_sequences([tmp_path / "runs"])] == ["a"]
    for name in ("code.ts", "b.h264"):
        with pytest.raises(SourceError, match="is a file of no kind that is read"):
            find_sequences([tmp_path / "runs" / name])


@scheduled_as_before()
def encoded(path: Path, codec: str, pixels: str = "yuv420p", **options: str) -> Path:
    """A video of 20 pictures, ten a second, by a codec that OpenCV does not write."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=10, options=options)
        stream.width, stream.height, stream.pix_fmt = 64, 48, pixels
        for picture in pictures():
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize(
    ("name", "codec"),
    [("run.mp4", "libx264"), ("run.mkv", "libx265"), ("run.webm", "libvpx-vp9"), ("run.m2ts", "libx264")],
)
def test_codecs_that_opencv_reads_and_does_not_write(tmp_path: Path, name: str, codec: str) -> None:
    options = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    path = encoded(tmp_path / name, codec, **options)
    sequence = find_one(path)
    assert type(sequence.recording) is Video
    assert np.allclose([frame.time for frame in sequence.frames], np.arange(20) / 10, atol=1e-3)
    assert equal(read_images(sequence), decoded(path))


@pytest.mark.parametrize(("name", "codec"), [("run.h264", "libx264"), ("run.265", "libx265")])
def test_a_stream_without_times_goes_by_a_rate(
    tmp_path: Path, name: str, codec: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / name
    quiet = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    encoded(path.with_suffix(".hevc" if codec == "libx265" else ".h264"), codec, **quiet).rename(path)
    (tmp_path / "run.labels").write_text("0 0.8 hall\n")
    sequence = find_one(path)
    assert [frame.time for frame in sequence.frames] == [i / 25 for i in range(20)]
    assert f"{path}: has no times; 25 frames a second are taken; or say --rate HZ" in caplog.messages
    caplog.clear()
    timed = find_one(path, rate=10)
    assert [(frame.time, frame.place) for frame in timed.frames] == [(i / 10, "hall" * (i < 8)) for i in range(20)]
    assert caplog.messages == []
    assert equal(read_images(timed), decoded(path))
    assert equal(read_images(find_one(path, rate=10, begin=1)), decoded(path)[10:])


def test_a_moving_gif_is_read_if_it_is_named(tmp_path: Path) -> None:
    path = encoded(tmp_path / "run.gif", "gif", "rgb8")
    sequence = find_one(path)
    assert np.allclose([frame.time for frame in sequence.frames], np.arange(20) / 10)
    assert equal(read_images(sequence), decoded(path))
    (tmp_path / "a.png").touch()
    assert [frame.name for frame in find_sequences([tmp_path])[0].frames] == ["a.png"]
