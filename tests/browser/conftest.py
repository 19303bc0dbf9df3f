"""One Chromium for all tests, and one search for all tests of the live page."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from .scripted import Served, served
from .stage import Stage, Watch, flying

ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PICTURES = os.environ.get("ROISEARCH_PICTURES")
"""Where to write the README's pictures; they are not made unless this is set."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """The system's Chromium; for one file only, since Playwright's event loop would be in the way of other tests."""
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("NO CHROMIUM: THE PAGE HAS NOT BEEN LOOKED AT (apt-get install chromium)")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    """A search of the demo area with nothing in it, so that it goes on for as long as the tests look at it."""
    with flying(tmp_path_factory.mktemp("stage"), speedup=6.0) as search:
        yield search


@pytest.fixture
def watch(chromium: Browser, stage: Stage) -> Iterator[Watch]:
    """A fresh page of that search; it must not complain about anything."""
    stage.go_on()
    page = Watch(chromium, stage.url)
    yield page
    page.close()


@pytest.fixture(scope="session")
def pictures() -> Path | None:
    """Where to write the README's pictures, or None."""
    return Path(PICTURES) if PICTURES else None


@pytest.fixture
def search() -> Iterator[Served]:
    """A search that says what the test tells it."""
    with served() as scripted:
        yield scripted
