"""A real browser for tests of pages: headless Chromium, driven through chromedriver."""

import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

# Nothing that asks the network, nor what a container has no right to.
_QUIET = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--disable-quic", "--hide-scrollbars", "--disable-dev-shm-usage"),
)


@contextmanager
def chromium(width: int = 1280, height: int = 800) -> Iterator[Any]:
    """A browser window of this size inside, with a profile of its own; skips the test where there is no browser."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium, which drives the browser")
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not browser or not driver:
        pytest.skip("needs a browser: chromium and chromedriver (Debian's chromium-driver) are not here")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, warnings.catch_warnings():
        # What selenium leaves to the garbage collector is no concern of ours.
        warnings.simplefilter("ignore", ResourceWarning)
        for argument in (*_QUIET, f"--user-data-dir={profile}", f"--window-size={width},{height}"):
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        window = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
        try:
            set_size(window, width, height)
            yield window
        finally:
            window.quit()


def set_size(window: Any, width: int, height: int) -> None:
    """Make what the page has of the window exactly so large, also narrower than a window can be."""
    window.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
    )


def complaints(window: Any) -> list[str]:
    """What the browser has to say of the page since it was asked last: errors, and what its policy refused."""
    return [entry["message"] for entry in window.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


def press(window: Any, *keys: str) -> None:
    """Press keys one after the other, wherever the focus is."""
    from selenium.webdriver import ActionChains

    ActionChains(window, duration=0).send_keys(*keys).perform()


def press_with(window: Any, held: str, *keys: str) -> None:
    """Press keys while another one is held."""
    from selenium.webdriver import ActionChains

    ActionChains(window, duration=0).key_down(held).send_keys(*keys).key_up(held).perform()


def picture_of(window: Any, path: Path) -> Path:
    """A screenshot of what is seen of the page."""
    path.write_bytes(window.get_screenshot_as_png())
    return path
