"""The strip that pages share, in a browser: what it draws, and how keys and the mouse move it."""

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.browser import complaints, picture_of, press, press_with, set_size

from placerec.figures import canvas
from placerec.page.assets import in_one, names, text

PAGE = """<!doctype html><meta charset="utf-8"><style>{style}</style><div id="strip"></div><script type="module">
{script}
const places = ["kitchen", "<b>hall</b>"];
const data = {{
  count: 100, times: Array.from({{ length: 100 }}, (_, i) => 50 + i / 10), places,
  rows: [
    {{ name: "places", drag: true, stretches: [[0, 40, 0], [40, 80, 1], [80, 100, -1]] }},
    {{ name: "belief", shares: Float32Array.from({{ length: 200 }}, (_, i) => i % 2 ? 0.25 : 0.75) }},
    {{ name: "doubt", levels: Array.from({{ length: 100 }}, (_, i) => i / 100) }},
  ],
}};
window.said = [];
window.strip = createStrip(document.getElementById("strip"), {{
  onFrame: (frame) => said.push(frame),
  onMark: (mark) => said.push(mark),
  onBorder: (row, border, frame, done) => said.push([row, border, frame, done]),
}});
strip.show(data);
</script>"""


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Any:
    set_size(browser, 800, 400)
    file = tmp_path / "strip.html"
    file.write_text(PAGE.format(style=text("page.css"), script=in_one("strip.js")), encoding="utf-8")
    browser.get(file.as_uri())
    browser.find_element("id", "strip").click()
    browser.execute_script("strip.go(0); strip.setMark(null); said.length = 0")
    return browser


def run(page: Any, script: str) -> Any:
    return page.execute_script(f"return {script}")


def test_the_colours_are_those_of_the_still_pictures() -> None:
    found = re.findall(r'"#([0-9a-f]{6})"', re.findall(r"PALETTE = \[(.*?)\]", text("colours.js"), re.DOTALL)[0])
    assert [int(colour, 16) for colour in found] == list(canvas._PALETTE)


def test_modules_can_be_put_into_one_script() -> None:
    modules = sorted(name for name in names() if name.endswith(".js"))
    assert {"strip.js", "axis.js", "colours.js"} < {*modules}
    top_level = [
        found
        for name in modules
        for found in re.findall(r"^(?:export )?(?:function|const|let) (\w+)", text(name), re.M)
    ]
    assert len(top_level) == len({*top_level}), "two modules call a thing alike"
    for name in modules:
        script = in_one(name)
        assert not re.search(r"^(import|export)\b", script, re.M), name
        assert "</script" not in script


def test_it_draws_stretches_in_the_colours_of_places(page: Any, tmp_path: Path) -> None:
    page.execute_script("strip.go(99)")
    picture = cv2.imread(str(picture_of(page, tmp_path / "strip.png")))
    assert picture is not None
    # The last fifth has no label, and is hatched.
    y = page.execute_script("return document.getElementById('strip').getBoundingClientRect().top") + 22 + 15 + 5
    row = picture[int(y)]
    colours = [tuple(row[x][::-1].tolist()) for x in (150, 400)]
    assert colours == [(0x56, 0xB4, 0xE9), (0xE6, 0x9F, 0x00)]
    assert len(np.unique(row[650:760], axis=0)) > 1
    assert complaints(page) == []


def test_keys_step_jump_and_go_to_borders(page: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    press(page, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    press_with(page, Keys.SHIFT, Keys.ARROW_RIGHT)
    press(page, Keys.PAGE_DOWN, Keys.PAGE_DOWN, Keys.PAGE_UP, Keys.END, Keys.ARROW_RIGHT, Keys.HOME)
    assert run(page, "said") == [1, 2, 1, 11, 40, 80, 40, 99, 99, 0]
    press(page, Keys.PAGE_DOWN)
    host = page.find_element("id", "strip")
    assert host.get_attribute("aria-valuetext") == "frame 40, 4.00 s, places: <b>hall</b>"
    press(page, "+", "+")
    assert run(page, "strip.view") == {"from": 3, "to": 5.5}
    press(page, "0")
    assert run(page, "strip.view") == {"from": 0, "to": 10}


def test_space_plays_at_the_pace_of_the_times(page: Any) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    press(page, " ")
    WebDriverWait(page, 10, 0.05).until(lambda window: run(window, "strip.frame") >= 5)
    press(page, " ")
    stopped = run(page, "strip.frame")
    assert 5 <= stopped < 60
    assert run(page, "strip.playing") is False


def test_the_mouse_marks_a_stretch_and_drags_a_border(page: Any) -> None:
    from selenium.webdriver import ActionChains

    host = page.find_element("id", "strip")
    middle = host.size["width"] / 2, host.size["height"] / 2

    def drag(x: float, to: float, y: float) -> None:
        scale = host.size["width"]
        chain = ActionChains(page, duration=20)
        chain.move_to_element_with_offset(host, round(x * scale - middle[0]), round(y - middle[1])).click_and_hold()
        chain.move_by_offset(round((to - x) * scale / 2), 0).move_by_offset(round((to - x) * scale / 2), 0)
        chain.release().perform()

    drag(0.1, 0.3, 22 + 15 + 13)
    assert run(page, "strip.mark") == [10, 30]
    page.execute_script("said.length = 0")
    drag(0.4, 0.45, 22 + 15 + 13)
    assert run(page, "said.at(-1)") == [0, 40, 45, True]
    assert run(page, "strip.mark") == [10, 30]


def test_it_is_as_wide_as_a_telephone(page: Any) -> None:
    set_size(page, 400, 400)
    assert run(page, "document.documentElement.scrollWidth") <= 400
    assert run(page, "document.querySelector('#strip canvas').clientWidth") > 350


def test_a_hundred_thousand_frames_are_drawn_at_once(page: Any) -> None:
    page.execute_script(
        "const n = 1e5; strip.show({ count: n, times: null, places: ['a', 'b'], rows: ["
        "{ name: 'x', stretches: [[0, n, 0]] }, { name: 'y', levels: new Float32Array(n).fill(0.5) },"
        "{ name: 'z', shares: new Float32Array(2 * n).fill(0.5) }] })"
    )
    took = page.execute_async_script(
        "const done = arguments[0]; requestAnimationFrame(() => { const from = performance.now(); strip.redraw();"
        "requestAnimationFrame(() => setTimeout(() => done(performance.now() - from))) })"
    )
    assert took < 1000
    assert run(page, "strip.view") == {"from": 0, "to": 100000}
