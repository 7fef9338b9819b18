"""`decode --live --page`, a video in place of the camera: what is believed is shown, and places are named there."""

import re
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.browser import complaints, press, set_size
from helpers.pages import serving
from helpers.recordings import write_video
from helpers.typed_commands import make_words, misused
from helpers.waiting import wait_until

from placerec.errors import SourceError
from placerec.frames import Frame, find_sequences
from placerec.hohmm.beliefs import parse_beliefs
from placerec.model import load_model
from placerec.page.keeping import KeptFrames
from placerec.page.live import LiveDesk
from placerec.page.server import Request
from placerec.words import read_stream

pytest.importorskip("waitress", reason="needs waitress, which serves the page")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of halls and kitchens with its words, and half a minute of both."""
    root = tmp_path_factory.mktemp("live")
    make_words(root)
    shutil.copy(root / "words.npz", root / "seen-model")
    images = [cv2.imread(str(path)) for path in sorted((root / "runs/seq2/std_cam").iterdir())]
    write_video(root / "drive.mp4", "mp4v", [np.asarray(image, np.uint8) for image in images for _ in range(25)])
    return root


def shown(window: Any, element: str) -> str:
    return str(window.execute_script("return document.getElementById(arguments[0]).textContent", element))


def test_a_place_is_named_kept_and_taught(browser: Any, world: Path, tmp_path: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    model = tmp_path / "model"
    shutil.copytree(world / "seen-model", model)
    how = ("-m", model, "--unknown", "--page", "--keep", tmp_path / "kept")
    with (
        (tmp_path / "out.tsv").open("w") as out,
        serving("decode", world / "drive.mp4", "--live", *how, stdout=out) as served,
    ):
        browser.get(served.address)
        complaints(browser)
        wait_until(lambda: "hall" in shown(browser, "bars"), "no belief is shown")
        wait_until(
            lambda: browser.execute_script("return document.getElementById('picture').naturalHeight") == 24, "no frame"
        )
        assert "unknown" in shown(browser, "bars")
        assert re.fullmatch(r"\d+ frames seen, \d+ dropped", shown(browser, "counts"))
        press(browser, "n", *"att<b>ic", Keys.ENTER)
        wait_until(lambda: "The camera is in att<b>ic; " in shown(browser, "kept"), "the place is not named")
        wait_until(lambda: int(shown(browser, "kept").split("; ")[1].split()[0]) > 8, "no frame is kept")
        press(browser, Keys.ESCAPE)
        wait_until(lambda: "The camera is in" not in shown(browser, "kept"), "naming does not end")
        press(browser, "t")
        wait_until(lambda: "has learned" in shown(browser, "said"), "the model is not taught")
        wait_until(lambda: "att<b>ic" in shown(browser, "bars"), "the new place is not believed in")
        set_size(browser, 400, 800)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= 400
        assert complaints(browser) == []
    assert list(load_model(model).models) == ["att<b>ic", "hall", "kitchen"]
    (kept,) = find_sequences([tmp_path / "kept"])
    places = [frame.place for frame in kept.frames]
    assert (kept.name, {*places}, places.count("")) == ("drive-1", {"att<b>ic", ""}, 1)
    assert all(np.diff([frame.time for frame in kept.frames]) > 0)
    stream = read_stream(tmp_path / "kept/drive-1.tsv")
    assert (stream.frames, list(stream.places)) == (tuple(frame.name for frame in kept.frames), places)
    before, _, after = (tmp_path / "out.tsv").read_text().rpartition("frame\ttime")
    first, second = (
        parse_beliefs(before, name="a", source="out"),
        parse_beliefs(f"frame\ttime{after}", name="b", source="out"),
    )
    assert (first.places, second.places) == (("hall", "kitchen"), ("att<b>ic", "hall", "kitchen"))
    assert {*first.truth} == {"att<b>ic", ""}


def test_without_a_folder_no_place_can_be_named(world: Path, tmp_path: Path) -> None:
    with (
        (tmp_path / "out.tsv").open("w") as out,
        serving("decode", world / "drive.mp4", "--live", "-m", world / "seen-model", "--page", stdout=out) as served,
    ):
        status, state, _ = served.below("now/0")
        assert (status, state["keeps"], state["places"]) == (200, False, ["hall", "kitchen"])
        status, told, _ = served.below("name", method="POST", sent={"place": "attic"})
        assert (status, told["error"].partition(":")[0]) == (400, "name no place")
        assert served.below("teach", method="POST", sent={})[0] == 400
        assert served.below("now/-1")[0] == 404
        assert served.ask("/now/0")[0] == 403
        wait_until(lambda: served.below("now/0")[1]["rows"], "no frame is answered")
        assert served.below("picture/0")[1][:3] == b"\xff\xd8\xff"
    assert len((tmp_path / "out.tsv").read_text().splitlines()) > 1


def test_options_of_the_page_need_the_page() -> None:
    misused("--page shows what comes live: it needs --live", "decode", "x.tsv", "-m", "model", "--page")
    for option in (("--keep", "x"), ("--port", 1), ("--host", "0.0.0.0"), ("--no-browser",)):
        misused(f"{option[0]} is of the page; it needs --page", "decode", "camera:0", "--live", "-m", "model", *option)


def test_names_are_checked_and_told_apart(world: Path, tmp_path: Path) -> None:
    from placerec.model import load_recognizer
    from placerec.vision import DictionarySet

    words = DictionarySet.load(world / "words.npz")
    decoder = load_recognizer(world / "seen-model", dictionary=words)
    desk = LiveDesk("run", decoder, world / "seen-model", lambda: decoder, tmp_path, words.names)

    def name(place: object) -> str:
        answer = desk.answer_page(Request("POST", ("name",), {"place": place}))
        assert answer
        return answer.body.decode()

    assert "holds a /; name it otherwise" in name("a/b")
    with pytest.raises(SourceError, match="differs only in case from 'hall'"):
        name("Hall")
    assert name("attic") == '{"place": "attic"}'
    assert name("") == '{"place": ""}'
    assert desk.place == ""


def test_kept_frames_have_a_free_name_and_end_their_visits(tmp_path: Path) -> None:
    (tmp_path / "run-1").mkdir()
    kept = KeptFrames(tmp_path, "run", ("",), {"run-2"})
    assert kept.name == "run-3"
    image = np.zeros((8, 8), np.uint8)
    for number, place in enumerate(["", "hall", "hall", "", "", "hall"]):
        kept.add(Frame(str(number), number / 10, "", Path("x")), image, ["w1"], [None], place)
    assert kept.count == 3
    stream = read_stream(kept.tokens)
    assert list(stream.places) == ["hall", "hall", "", "hall"]
    assert list(stream.times) == [0.1, 0.2, 0.3, 0.5]
    assert (kept.folder / "places.lst").read_text().splitlines() == [f"t{t:.6f}.png hall" for t in (0.1, 0.2, 0.5)]
