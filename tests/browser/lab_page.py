"""The page in Debian's chromium, without a display; what it logs and asks of the network is collected."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

BENCH = Path(__file__).parents[2] / "cosim_examples" / "data" / "bench"
SHOTS = Path(os.environ.get("TUBULAR_DEA_SHOTS", Path(__file__).parents[2] / "build" / "screenshots"))
BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")


class Page:
    """One open page. `run` evaluates JavaScript in it, `asked` and `said` are its requests and messages so far."""

    def __init__(self, path: Path, downloads: Path) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        options.binary_location = str(BROWSER)
        for argument in ("headless=new", "no-sandbox", "disable-gpu", "hide-scrollbars", "disable-dev-shm-usage"):
            options.add_argument(f"--{argument}")
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        options.add_experimental_option(
            "prefs",
            {
                "download.default_directory": str(downloads),
                "profile.default_content_setting_values.automatic_downloads": 1,
            },
        )
        self.driver = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
        self.driver.set_script_timeout(120)
        self.path, self.said, self._asked = path, [], []

    def open(self, fragment: str = "") -> Page:
        """The page, loaded anew, with its first plot drawn."""
        self.close()
        self.driver.get(f"{self.path.as_uri()}{fragment}")
        self.wait("window.lab && lab.firstPlot")
        return self

    def close(self) -> None:
        """Leave the page, which plays on while it is open and takes a processor; the browser stays."""
        self.driver.get("about:blank")

    def ready(self) -> Page:
        """The page as it is; if there is none, one that stands still."""
        if not self.driver.current_url.startswith("file:"):
            self.open()
            self.show("data")
        return self

    def run(self, script: str, *arguments: object) -> object:
        """The value of a JavaScript function's body; promises are waited for."""
        wrapped = (
            "const done = arguments[arguments.length - 1];"
            f"(async (...given) => {{ {script} }})(...Array.from(arguments).slice(0, -1))"
            ".then((value) => done({ value }), (problem) => done({ problem: String(problem.stack) }));"
        )
        answer = self.driver.execute_async_script(wrapped, *arguments)
        assert "problem" not in answer, answer["problem"]
        return answer.get("value")

    def wait(self, condition: str, seconds: float = 60) -> None:
        """Until a JavaScript expression holds."""
        from selenium.webdriver.support.ui import WebDriverWait

        WebDriverWait(self.driver, seconds, 0.02).until(lambda d: d.execute_script(f"return Boolean({condition})"))

    def show(self, view: str) -> None:
        self.run(f"lab.change('view', (s) => {{ s.view = '{view}'; }});")
        settled = {"heart": "lab.H.result", "data": "!lab.D.experiments.length || lab.D.runs"}.get(view)
        if settled:
            self.wait(settled)

    def size(self, width: int, height: int = 1000) -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def shot(self, name: str, width: int) -> Path:
        """The whole page as a picture among CI's artefacts."""
        self.size(width)
        self.run("await new Promise((r) => setTimeout(r, 300));")
        self.size(width, int(self.run("return document.documentElement.scrollHeight;")))
        self.run("await new Promise((r) => setTimeout(r, 300));")
        SHOTS.mkdir(parents=True, exist_ok=True)
        path = SHOTS / f"{name}.png"
        self.driver.save_screenshot(str(path))
        self.size(1280)
        return path

    def messages(self) -> list[str]:
        """What the console said since the last time."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def requests(self) -> list[str]:
        """Everything that was asked for, but the page itself and what it made."""
        events = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        urls = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
        own = ("blob:", "data:", "about:", self.path.as_uri())
        return [url for url in urls if not url.startswith(own)]


def carried_out(folder: Path, *program: str) -> str:
    path = {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False, env=os.environ | path)
    assert done.returncode == 0, done.stderr
    return done.stdout


def commands(folder: Path, text: str) -> None:
    """Carries out what the page copies, as somebody would in a shell."""
    carried_out(folder, "bash", "-ec", f'tubular-dea() {{ "{sys.executable}" -m tubular_dea.cli "$@"; }}\n{text}')


def python(folder: Path) -> str:
    return carried_out(folder, sys.executable, "figure.py")


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    values = np.array(rows[1:], float)
    return {heading.partition(" [")[0]: values[:, i] for i, heading in enumerate(rows[0])}


def opened(path: Path, downloads: Path) -> Page:
    """The page of a file in a browser of its own; the test is skipped where there is none."""
    pytest.importorskip("selenium", reason="the test extra brings selenium")
    if not BROWSER or not DRIVER:
        pytest.skip("chromium and its driver are not installed (apt-get install chromium chromium-driver)")
    page = Page(path, downloads)
    page.size(1280)
    return page
