"""The report in a browser: pointing, keys, filters, two systems, a narrow screen, paper."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.browser import complaints, picture_of, press, press_with, set_size
from helpers.decoded_images import write_decoded_images
from helpers.small_world import beliefs_of
from helpers.waiting import wait_until

from placerec.page.drives import Drive
from placerec.page.report import report, report_page

PLACES = ("hall", "<b>kitchen</b>", "office")
RUN = [0] * 10 + [1] * 10 + [2] * 10


def drive(name: str, **wrong: dict[int, int]) -> Drive:
    """Thirty frames, ten of each place; `wrong`: by system the frames that are decided otherwise, and as what."""
    systems = {}
    for system, frames in wrong.items():
        best = [frames.get(k, RUN[k]) for k in range(30)]
        belief = np.full((30, 3), 0.1)
        belief[np.arange(30), best] = 0.8
        for k in frames:
            belief[k] = (0.25, 0.25, 0.25)
            belief[k, best[k]] += 0.25
        truth, decided = ([PLACES[place] for place in column] for column in (RUN, best))
        found = beliefs_of(name, PLACES, truth, decided, belief, np.arange(30) / 2 + 1000)
        systems[system] = replace(found, stream=found.stream.renamed(name))
    return Drive(name, systems)


DRIVES = [
    drive("a</script>", good={4: 1, 5: 1}, poor={4: 2, 12: 0, 13: 0, 29: 1}),
    drive("b", good={20: 0}, poor={20: 0}),
]


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Any:
    file = tmp_path / "report.html"
    file.write_text(report_page("Two drives", DRIVES), encoding="utf-8")
    browser.get(file.as_uri())
    return browser


def moment(page: Any) -> str:
    return str(page.find_element("css selector", ".moment h2").text)


def shown(page: Any, selector: str) -> list[str]:
    return [element.text for element in page.find_elements("css selector", selector)]


def choose(page: Any, number: int, text: str) -> None:
    from selenium.webdriver.support.ui import Select

    Select(page.find_elements("css selector", ".controls select")[number]).select_by_visible_text(text)


def test_it_opens_from_disk_at_the_first_error_and_the_browser_has_nothing_to_say(page: Any) -> None:
    assert page.find_element("css selector", ".headline").text == (
        "95.0 % of 60 labelled frames right by good; always hall would be 33.3 %."
    )
    assert moment(page) == "a</script>, frame 4, 2.0 s"
    assert shown(page, ".verdicts > div") == ["true\nhall", "decided\n<b>kitchen</b>\n✕"]
    assert shown(page, ".belief .number") == ["25.0 %", "50.0 %", "25.0 %"]
    assert shown(page, ".drive h3") == ["a</script> 93.3 % of 30 right", "b 96.7 % of 30 right"]
    assert complaints(page) == []


def test_the_mouse_shows_a_moment_and_a_click_keeps_it(page: Any) -> None:
    from selenium.webdriver import ActionChains

    host = page.find_elements("css selector", ".strip")[1]
    width = host.size["width"]
    # The axis begins at the left edge, and both drives are as long as it is.
    at = round((14.5 / 30 - 0.5) * width)
    ActionChains(page, duration=0).move_to_element_with_offset(host, at, 20).perform()
    assert moment(page) == "b, frame 14, 7.0 s"
    ActionChains(page, duration=0).move_to_element(page.find_element("css selector", "h1")).perform()
    assert moment(page) == "a</script>, frame 4, 2.0 s"
    ActionChains(page, duration=0).move_to_element_with_offset(host, at, 20).click().perform()
    ActionChains(page, duration=0).move_to_element(page.find_element("css selector", "h1")).perform()
    assert moment(page) == "b, frame 14, 7.0 s"
    assert page.execute_script("return location.hash") == "#b/14"


def test_keys_step_through_frames_drives_and_errors(page: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    press(page, Keys.ARROW_RIGHT)
    assert moment(page).startswith("a</script>, frame 5")
    press_with(page, Keys.SHIFT, Keys.ARROW_RIGHT)
    assert moment(page).startswith("a</script>, frame 15")
    press(page, Keys.ARROW_DOWN)
    assert moment(page).startswith("b, frame 0")
    press(page, "e")
    # The next error, of two runs of them.
    assert moment(page).startswith("b, frame 20")
    assert page.find_element("css selector", ".controls output").text == "2 of 2 moments"
    press(page, "n")
    assert moment(page).startswith("a</script>, frame 4")
    press(page, "p")
    assert moment(page).startswith("b, frame 20")
    press(page, "u")
    # As unsure as b's frame 20, and before it.
    assert moment(page).startswith("a</script>, frame 4")
    press(page, "n")
    assert moment(page).startswith("b, frame 20")


def test_changes_are_those_of_the_label_and_of_what_is_decided(page: Any) -> None:
    press(page, "c")
    # Of drive a at frames 4 and 6 by mistake, at 10 and 20 rightly; of b at 10, 21 and by mistake at 20.
    found = []
    for _ in range(7):
        found.append(moment(page).removesuffix(" s").rsplit(",", 1)[0])
        press(page, "n")
    assert found == [f"a</script>, frame {k}" for k in (4, 6, 10, 20)] + [f"b, frame {k}" for k in (10, 20, 21)]


def test_a_place_filters(page: Any) -> None:
    office = page.find_elements("css selector", ".legend button")[2]
    office.click()
    assert office.get_attribute("aria-pressed") == "true"
    output = page.find_element("css selector", ".controls output")
    assert output.text.endswith("20 moments")
    press(page, "e")
    assert output.text == "1 of 1 moments"
    assert moment(page).startswith("b, frame 20")
    press(page, "a")
    assert office.get_attribute("aria-pressed") == "false"
    assert output.text.endswith("60 moments")


def test_two_systems_stand_beside_each_other(page: Any) -> None:
    choose(page, 1, "poor")
    assert shown(page, ".drive h3")[0] == "a</script> good: 93.3 % of 30 right, poor: 86.7 % of 30 right"
    choose(page, 2, "only the first is right")
    output = page.find_element("css selector", ".controls output")
    assert output.text == "1 of 2 moments"
    assert moment(page).startswith("a</script>, frame 12")
    assert [line.splitlines()[0] for line in shown(page, ".verdicts > div")] == ["true", "good", "poor"]
    assert len(page.find_elements("css selector", ".belief meter")) == 6
    choose(page, 2, "only the second is right")
    assert moment(page).startswith("a</script>, frame 5")
    page.find_element("css selector", "h1").click()
    press(page, "d")
    # Frames 4, 5, 12 and 29: at 4 both are wrong, each in a way of its own.
    assert output.text.endswith("of 4 moments")
    assert complaints(page) == []


def test_an_address_leads_to_its_moment(page: Any) -> None:
    page.execute_script("location.hash = '#b/7'")
    assert moment(page).startswith("b, frame 7")
    page.execute_script("location.hash = '#nothing%'")
    assert moment(page).startswith("b, frame 7")


def test_it_fits_a_narrow_screen(page: Any) -> None:
    set_size(page, 400, 700)
    assert page.execute_script("return document.documentElement.scrollWidth") == 400
    page.execute_script("document.querySelectorAll('.strip')[0].scrollIntoView()")
    box = page.find_element("css selector", ".moment").rect
    # The moment stays in sight below the strips.
    assert page.execute_script("return document.querySelector('.moment').getBoundingClientRect().bottom") <= 700
    assert box["width"] >= 380


def test_on_a_narrow_screen_the_drive_that_is_gone_to_stands_above_the_moment(page: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    set_size(page, 400, 700)
    page.execute_script("scrollTo(0, 0)")
    press(page, Keys.ARROW_DOWN)
    assert moment(page).startswith("b, frame 0")
    bottom = page.execute_script("return document.querySelector('.drive.current').getBoundingClientRect().bottom")
    assert bottom <= page.execute_script("return document.querySelector('.moment').getBoundingClientRect().top")


def test_paper_gets_the_still_picture(page: Any) -> None:
    def there(selector: str) -> bool:
        return bool(page.find_element("css selector", selector).is_displayed())

    assert (there("#report"), there(".still")) == (True, False)
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        assert (there("#report"), there(".still")) == (False, True)
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_a_drive_of_hours_is_stepped_through(browser: Any, tmp_path: Path) -> None:
    """More frames than a call in JavaScript can have arguments."""
    n = 150_000
    truth = [PLACES[k // 700 % 2] for k in range(n)]
    decided = ["office" if k == 140_000 else place for k, place in enumerate(truth)]
    (tmp_path / "r.html").write_text(
        report_page("r", [Drive("long", {"": beliefs_of("long", PLACES, truth, decided)})])
    )
    browser.get((tmp_path / "r.html").as_uri())
    assert moment(browser) == "long, frame 140000"
    press(browser, "c")
    press(browser, "p")
    assert moment(browser) == "long, frame 139300"
    assert complaints(browser) == []


def test_frames_words_and_reasons_of_a_real_model_are_shown(browser: Any, tmp_path: Path) -> None:
    root = write_decoded_images(tmp_path)
    report([root / "beliefs"], root / "r.html", frames=[root / "runs"], words=root / "words.npz")
    browser.get((root / "r.html").as_uri() + "#run2/7")
    assert moment(browser).startswith("run2, frame 7")
    image = browser.find_element("css selector", ".moment .frame")
    natural = browser.execute_script("return [arguments[0].naturalWidth, arguments[0].naturalHeight]", image)
    assert natural == [32, 24]
    assert browser.find_elements("css selector", ".word .tile")
    assert browser.find_element("css selector", ".moment h3").text == "Words"
    browser.find_element("css selector", ".moment summary").click()
    heads = shown(browser, ".models th")
    assert heads[0] == "place"
    assert heads[-2:] == ["together", "belief before"]
    assert len(shown(browser, ".models tbody tr")) == 2
    assert re.search(r"[×÷] \d", "".join(shown(browser, ".arguments td.number")))
    # The film is there: something else than one colour.
    browser.execute_script("scrollTo(0, 0)")
    top = browser.find_element("css selector", ".strip").rect
    x, y = round(top["x"]), round(top["y"])

    def film_is_there() -> bool:
        picture = cv2.imread(str(picture_of(browser, tmp_path / "shot.png")))
        assert picture is not None
        return len(np.unique(picture[y + 5 : y + 55, x + 5 : x + 60].reshape(-1, 3), axis=0)) > 20

    wait_until(film_is_there, "no picture comes into the film")
    assert complaints(browser) == []
