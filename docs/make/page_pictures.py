"""The pictures of docs/page.md: screenshots of the pages, of what `placerec demo` made.

placerec demo -o demo/
python docs/make/page_pictures.py demo/ docs/page

Needs the extras page and test, and Debian's chromium and chromium-driver. Screenshots depend on fonts and on the
browser, and the live page on the moment: nothing compares them.
"""

import shutil
import sys
import tempfile
from contextlib import chdir
from pathlib import Path
from typing import Any

import cv2
import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))
from helpers.browser import chromium, picture_of, press, set_size
from helpers.pages import serving
from helpers.recordings import write_video
from helpers.waiting import wait_until
from selenium.webdriver.common.keys import Keys

# A drive that the model was not learned from.
DRIVE = "seq3_sunny3"
# A moment of which there is much to say: what argued for it, and wrongly.
MOMENT = "#seq4_cloudy3/79"
# Frames a second of the drive in place of a camera; frames before a place is named, and with it.
RATE, BEFORE, NAMED = 5, 60, 20


def shown(window: Any, element: str) -> str:
    """The text of an element."""
    return str(window.execute_script("return document.getElementById(arguments[0]).textContent", element))


def picture(window: Any, path: Path) -> None:
    """A screenshot, when the pictures of frames have come, too."""
    window.execute_async_script("setTimeout(arguments[0], 700)")
    picture_of(window, path)


def draw_report(window: Any, demo: Path, out: Path) -> None:
    """The report at a moment, as wide as a desk's screen and as a hand's."""
    for name, width in (("report.png", 1280), ("report-narrow.png", 400)):
        set_size(window, width, 800)
        window.get("about:blank")
        window.get((demo / "report.html").as_uri() + MOMENT)
        picture(window, out / name)


def draw_label(window: Any, demo: Path, out: Path) -> None:
    """A drive of which the first half is labelled, and what a model proposes for the rest."""
    shutil.copytree(demo / "lab" / DRIVE, DRIVE)
    labels = Path(DRIVE, "localization/places.lst")
    lines = sorted(labels.read_text(encoding="utf-8").splitlines(keepends=True))
    labels.write_text("".join(lines[: len(lines) * 6 // 10]), encoding="utf-8")
    set_size(window, 1280, 780)
    with serving("label", DRIVE, "-m", "model") as served:
        window.get(served.address)
        wait_until(lambda: shown(window, "looks"), "nothing is proposed")
        press(window, Keys.ARROW_DOWN)
        picture(window, out / "label.png")


def draw_live(window: Any, demo: Path, out: Path) -> None:
    """The drive as a video, and a place that is named."""
    images = [cv2.imread(str(path)) for path in sorted((demo / "lab" / DRIVE / "std_cam").iterdir())]
    write_video(Path("drive.mp4"), frames=[np.asarray(image, np.uint8) for image in images], rate=RATE)
    set_size(window, 1280, 720)
    how = ("-m", "model", "--live", "--page", "--unknown", "--keep", "kept")
    with Path("out.tsv").open("w") as lines, serving("decode", "drive.mp4", *how, stdout=lines) as served:
        window.get(served.address)
        wait_until(lambda: len(Path("out.tsv").read_text().splitlines()) > BEFORE, "no frame comes")
        press(window, "n", *"corridor", Keys.ENTER)
        wait_until(lambda: f" {NAMED} frames are kept" in shown(window, "kept"), "no frame is kept")
        picture(window, out / "live.png")


def main() -> None:
    demo, out = (Path(path).resolve() for path in sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder, chdir(folder), chromium() as window:
        draw_report(window, demo, out)
        shutil.copytree(demo / "model", "model")
        draw_label(window, demo, out)
        draw_live(window, demo, out)


if __name__ == "__main__":
    main()
