"""One browser for all tests of the page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from lab_page import BENCH, Page, opened

from tubular_dea.cli import main


@pytest.fixture(scope="session")
def lab_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page with the bench's recordings, as the command writes it."""
    path = tmp_path_factory.mktemp("lab") / "lab.html"
    assert main(["lab", "--data", str(BENCH), "--out", str(path)]) == 0
    return path


@pytest.fixture(scope="session")
def downloads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the browser saves files."""
    return tmp_path_factory.mktemp("downloads")


@pytest.fixture(scope="session")
def chromium(lab_file: Path, downloads: Path) -> Iterator[Page]:
    """One browser for all tests."""
    page = opened(lab_file, downloads)
    yield page
    page.driver.quit()


@pytest.fixture(scope="module")
def browser(chromium: Page) -> Iterator[Page]:
    """The browser with whatever page the last test left; an open one plays on, which takes half a processor."""
    yield chromium
    chromium.close()


@pytest.fixture
def page(browser: Page) -> Iterator[Page]:
    """The page, freshly opened; it must neither log anything nor ask for anything."""
    browser.open()
    yield browser
    assert browser.messages() == []
    assert browser.requests() == []
