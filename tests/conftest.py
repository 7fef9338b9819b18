"""What several test modules share."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers.browser import chromium, complaints, set_size
from hypothesis import settings

# The same cases every time: whether a change is green must not depend on luck. Search with HYPOTHESIS_PROFILE=search.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("search", max_examples=1000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared() -> Path:
    """The read-only material beside the checkout; tests that need it are skipped where it is absent."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip("needs the reference material in ../shared, which is not here")
    return folder


@pytest.fixture(scope="session")
def started_browser() -> Iterator[Any]:
    """One for all tests of pages: it takes seconds to start."""
    with chromium() as window:
        yield window


@pytest.fixture
def browser(started_browser: Any) -> Any:
    """A browser with an empty page of 1280 x 900, and nothing left of other tests."""
    started_browser.get("about:blank")
    set_size(started_browser, 1280, 900)
    complaints(started_browser)
    return started_browser
