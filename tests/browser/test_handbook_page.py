"""The handbook in a browser: equations are seen whole, and a root spans what is under it."""

from __future__ import annotations

import io
import shutil
import subprocess

import matplotlib.image
import numpy as np
import pytest
from lab_page import Page

from tubular_dea.cli import main

FONTS = ("STIX Two Math", "Cambria Math", "Latin Modern Math", "Noto Sans Math", "DejaVu Math TeX Gyre")


@pytest.fixture(scope="module")
def handbook(browser: Page, tmp_path_factory: pytest.TempPathFactory) -> Page:
    path = tmp_path_factory.mktemp("handbook") / "handbook.html"
    assert main(["handbook", "--out", str(path)]) == 0
    browser.size(1200)
    browser.driver.get(path.as_uri())
    yield browser
    browser.size(1280)
    browser.requests()  # of this page, which are none of the next one's
    browser.close()


def test_no_equation_of_the_models_is_cut_off(handbook: Page) -> None:
    seen = handbook.run("""
        const models = document.querySelector("section[id^=Models]"), all = [...models.querySelectorAll(".eq")];
        return [all.length, all.filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.textContent)];
    """)
    assert seen[0] > 60 and seen[1] == []


def test_a_root_spans_what_is_under_it(handbook: Page) -> None:
    """Its hook is at the foot of the picture; a font without variants leaves a small sign at the top."""
    if not shutil.which("fc-list") or not any(f in subprocess.check_output(["fc-list"], text=True) for f in FONTS):
        pytest.skip("none of the fonts for mathematics is installed (apt-get install fonts-dejavu)")
    root = handbook.driver.find_element("css selector", "section[id^=Models] msqrt")
    picture = matplotlib.image.imread(io.BytesIO(root.screenshot_as_png))[..., :3].mean(axis=2)
    sign = np.argwhere(picture[:, : picture.shape[0] // 5] < 0.5)[:, 0] / picture.shape[0]
    assert sign.max() > 0.9
