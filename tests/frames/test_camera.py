"""Cameras: how they are named, what is wrong with them, and a real one on a network that is this machine's own."""

import logging
import os
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.network_camera import jpegs, network_camera
from helpers.small_world import write_images

from placerec.errors import SourceError
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.camera import Camera, is_camera


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    return jpegs(write_images(tmp_path_factory.mktemp("camera") / "run") / "std_cam")


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("camera:0", "camera0"),
        ("camera:/dev/video2", "video2"),
        ("camera:rtsp://robot:secret@10.0.0.5:554/live/main?user=x", "10.0.0.5-554-live-main"),
        ("camera:http://[::1]/", "1"),
        ("camera:http://[bad", "bad"),
    ],
)
def test_the_name_of_a_camera(source: str, name: str) -> None:
    assert is_camera(source)
    (sequence,) = find_sequences([source], endless=True)
    assert (sequence.name, list(sequence.frames)) == (name, [])
    assert sequence.recording is not None
    assert sequence.recording.endless
    assert sequence.recording.files() == []
    assert "secret" not in f"{sequence.recording}{sequence.source}"
    assert find_sequences(source, endless=True)[0].name == name


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        (["camera:x.mp4"], "camera:x.mp4: is no camera; name camera:0, camera:/dev/video0 or camera:rtsp://...$"),
        (["camera:"], "camera:: is no camera"),
        (["camera:0", "elsewhere"], "camera:0: a camera is read until it is stopped, with nothing beside it"),
        (["camera:0", "camera:1"], "camera:0: a camera is read until it is stopped, with nothing beside it"),
        ([Path("camera:http://here")], "camera:http:/here: is no camera; .*; give an address as text, not as a path"),
    ],
)
def test_what_is_no_camera(sources: list[str | Path], message: str) -> None:
    with pytest.raises(SourceError, match=message):
        find_sequences(sources, endless=True)


def test_what_needs_frames_again_takes_no_camera() -> None:
    with pytest.raises(SourceError, match="camera:0: a camera is for tokenize and decode alone; make a video with it"):
        find_sequences(["camera:0"])


DEVICES = [
    ("987", "camera:987: there is no /dev/video987; cameras on this machine: "),
    ("/dev/zero", "camera:/dev/zero: cannot be opened as a camera; check whether a program uses it"),
    (__file__, f"camera:{__file__}: is no device; for a file or a folder leave camera: out"),
]


@pytest.mark.parametrize(("source", "message"), DEVICES)
@pytest.mark.skipif(sys.platform != "linux", reason="device files are Linux's")
def test_devices_that_are_no_cameras(source: str, message: str) -> None:
    with pytest.raises(SourceError) as raised:
        list(Camera(source).frames())
    assert str(raised.value).startswith(message)


def test_addresses_without_a_camera(tmp_path: Path) -> None:
    page = [b"<html>no camera here</html>"] * 3
    with network_camera([]) as silent, network_camera(page) as other, network_camera([]) as gone:
        pass
    for address in (gone, "gopher://127.0.0.1/x"):
        with pytest.raises(SourceError, match=f"camera:{address}: cannot be opened as a camera; check the address"):
            list(Camera(address).frames())
    with network_camera([]) as silent, network_camera(page) as other:
        for address in (silent, other):
            with pytest.raises(SourceError, match=f"camera:{address}: (cannot be opened|gives no image)"):
                list(Camera(address).frames())


def test_a_camera_that_is_silent_is_given_up(monkeypatch: pytest.MonkeyPatch, pictures: list[bytes]) -> None:
    monkeypatch.setattr("placerec.frames.camera.WAIT", 1)
    begin = time.monotonic()
    with network_camera([], hang=True) as address, pytest.raises(SourceError, match="cannot be opened as a camera"):
        list(Camera(address).frames())
    with network_camera(pictures, hang=True) as address:
        assert len(list(Camera(address).frames())) == len(pictures)
    assert time.monotonic() - begin < 40


def test_a_network_camera_gives_what_it_sees(pictures: list[bytes], caplog: pytest.LogCaptureFixture) -> None:
    with network_camera(pictures) as address, caplog.at_level(logging.INFO):
        begin = time.time()
        images = list(Camera(address).frames())
        assert len(images) == len(pictures)
    for number, ((frame, image), picture) in enumerate(zip(images, pictures, strict=True)):
        expected = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert expected is not None
        assert isinstance(image, np.ndarray)
        assert frame.name == f"{number:06d}"
        # Two decoders of JPEG, one of which goes through colours, on noise.
        assert np.abs(image.astype(float) - expected).mean() < 2
    times = [frame.time for frame, _ in images]
    assert times == sorted(times)
    assert begin - 1 < times[0] < times[-1] < time.time() + 1
    assert f"camera:{address}: gives no more images" in caplog.text
    assert f"{len(pictures)} images came, 0 of them dropped" in caplog.text


def test_every_so_many_images(pictures: list[bytes]) -> None:
    with network_camera(pictures) as address:
        (sequence,) = find_sequences([f"camera:{address}"], options=SourceOptions(every=5), endless=True)
        assert sequence.recording is not None
        assert [frame.name for frame, _ in sequence.recording.frames()] == ["000000", "000005", "000010"]


def test_a_camera_has_neither_labels_nor_topics() -> None:
    for source_options in (SourceOptions(labels=Path(__file__)), SourceOptions(topic="/camera")):
        with pytest.raises(SourceError, match="camera:0: is a camera, which has neither labels nor topics"):
            find_sequences(["camera:0"], options=source_options, endless=True)


def test_damaged_images_do_not_end_it(pictures: list[bytes]) -> None:
    damaged = [*pictures[:4], b"\xff\xd8 no image \xff\xd9", pictures[4][: len(pictures[4]) // 2], *pictures[6:]]
    with network_camera(damaged) as address:
        images = list(Camera(address).frames())
    assert [int(frame.name) for frame, _ in images] == [*range(len(pictures))]
    assert [isinstance(image, str) for _, image in images] == [number in (4, 5) for number in range(len(pictures))]
    assert images[5][1] == f"camera:{address}: frame 000005 cannot be decoded"


def test_nothing_of_opencv_or_ffmpeg_reaches_stderr(pictures: list[bytes]) -> None:
    """In a process of its own: their levels are read once, and what they write does not go through sys.stderr."""
    code = "import sys; from placerec.frames.camera import Camera\nfor s in sys.argv[1:]:\n"
    code += "    try: print(len(list(Camera(s).frames())))\n    except Exception as error: print(error)"
    damaged = [*pictures[:6], pictures[6][:200], *pictures[7:]]
    with network_camera(damaged) as address, network_camera([]) as silent:
        sources = (
            address,
            silent,
            "http://127.0.0.1:1/",
            "rtsp://127.0.0.1:1/",
            "http://nowhere.invalid/",
            "0",
            "/dev/zero",
        )
        run = subprocess.run([sys.executable, "-c", code, *sources], capture_output=True, text=True, env=os.environ)
    assert run.stderr in ("", f"camera:{address}: gives no more images\n")
    assert len(run.stdout.splitlines()) == len(sources)
