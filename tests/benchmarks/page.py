"""The page on this machine: opening, frames, an assisted run, the map; its compiled C against the native kernel's.

Usage: python tests/benchmarks/page.py        (chromium and its driver are needed; about half a minute)
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "browser"))

from lab_page import BENCH, Page

from told import parser
from tubular_dea.cli import main
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import tubular_dea
from tubular_dea.protocol import Protocol

RUNS = 400  # of the step experiment, each way, in turns
TURNS = 5
STEP = Protocol.of([0.0, 1.0, 1.0, 8.0, 8.0, 15.0], pressure=[12666.0] * 6, voltage=[0.0, 0.0, 5e3, 5e3, 0.0, 0.0])
IN_PAGE = """  // runs; their time is what the page's thread has worked
    const { engine, facts } = lab, values = Object.fromEntries(facts.tube.parameters.map((q) => [q.name, q.value]));
    const drive = { time: given[0], inputs: { pressure: given[1], voltage: given[2] } }, samples = [15];
    values.start_at_equilibrium = 1;
    const once = () => engine.trajectory("tube", facts.tube, values, drive, samples);
    for (let i = 0; i < given[3]; i++) once();
"""


def worked(page: Page, script: str, *arguments: object) -> float:
    """Milliseconds that the page's thread computed for a script: what others do on the machine does not count."""

    def now() -> float:
        metrics = page.driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
        return next(m["value"] for m in metrics if m["name"] == "TaskDuration")

    page.driver.execute_cdp_cmd("Performance.disable", {})
    page.driver.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
    begun = now()
    page.run(script, *arguments)
    return 1e3 * (now() - begun)


def step_experiment(page: Page) -> tuple[float, float]:
    """Milliseconds of the 15 s step experiment: native kernel through Python, and in the page; best of some turns."""
    kernel, at_rest = Kernel(tubular_dea()), {"start_at_equilibrium": 1.0}
    native, browser = [], []
    for _ in range(TURNS):
        begun = time.process_time()
        for _ in range(RUNS):
            kernel.simulate(STEP, np.array([15.0]), at_rest)
        native.append(1e3 * (time.process_time() - begun) / RUNS)
        columns = [STEP.time.tolist(), STEP.inputs["pressure"].tolist(), STEP.inputs["voltage"].tolist()]
        browser.append(worked(page, IN_PAGE, *columns, RUNS) / RUNS)
    return min(native), min(browser)


def long_experiment(page: Page) -> tuple[float, float]:
    """The same with 300 steps of the voltage, in which calls count for nothing."""
    kernel, n = Kernel(tubular_dea()), 300
    marks = np.repeat(np.arange(n + 1.0), 2)[1:-1]
    volts = np.repeat(np.where(np.arange(n) % 2, 5e3, 0.0), 2)
    protocol = Protocol.of(marks.tolist(), pressure=[12666.0] * marks.size, voltage=volts.tolist())
    native, browser = [], []
    for _ in range(TURNS):
        begun = time.process_time()
        for _ in range(20):
            kernel.simulate(protocol, np.array([15.0]), {"start_at_equilibrium": 1.0})
        native.append(1e3 * (time.process_time() - begun) / 20)
        browser.append(worked(page, IN_PAGE, marks.tolist(), [12666.0] * marks.size, volts.tolist(), 20) / 20)
    return min(native), min(browser)


def assisted(page: Page) -> float:
    """Milliseconds of one 12-beat assisted run in the page."""
    page.show("heart")
    return min(
        worked(
            page,
            """
        const { pace, stop } = lab.pacing(), values = lab.heartValues();
        for (let i = 0; i < 4; i++) lab.engine.coupled(lab.facts.heart, values, pace, stop, lab.facts.heart.step);
    """,
        )
        / 4
        for _ in range(TURNS)
    )


def whole_map(page: Page) -> tuple[float, float]:
    """Seconds of the map of 20 x 20 settings, and until its first cell was drawn."""
    begun = time.perf_counter()
    page.run("document.getElementById('map-start').click();")
    page.wait("lab.H.map.cells && lab.H.map.cells.size > 0")
    first = time.perf_counter() - begun
    page.wait("lab.H.map.seconds && !lab.H.map.going", 300)
    return page.run("return lab.H.map.seconds;"), first


def frames(page: Page) -> tuple[float, float]:
    """Median milliseconds of work in a frame, and between frames, while the tube is played by hand."""
    page.open()
    page.run("for (const n of ['pressure', 'voltage']) lab.change('tube', (s) => { s.tube.inputs[n].kind = 'hand'; });")
    page.run("""
        lab.frames.work.length = lab.frames.gap.length = 0;
        for (let i = 0; i < 120; i++) {
          lab.change("tube", (s) => { s.tube.inputs.pressure.level = 80 + 20 * Math.sin(i / 9); });
          await new Promise((r) => requestAnimationFrame(r));
        }
    """)
    work, gap = page.run("return [lab.frames.work, lab.frames.gap];")
    return float(np.median(work)), float(np.median(gap))


def run() -> None:
    """Print one line a figure."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lab.html"
        main(["lab", "--data", str(BENCH), "--out", str(path)])
        page = Page(path, Path(folder))
        opened = min(page.open().run("return lab.firstPlot;") for _ in range(5))
        print(f"page {path.stat().st_size / 1e6:.2f} MB; first plot {opened:.0f} ms after opening")
        native, browser = step_experiment(page)
        print(f"15 s step: native {1e3 * native:.0f} us, page {1e3 * browser:.0f} us, {browser / native:.2f}")
        native, browser = long_experiment(page)
        print(f"300 s, 300 steps: native {native:.2f} ms, page {browser:.2f} ms, {browser / native:.2f} times")
        work, gap = frames(page)
        print(f"by hand: {work:.1f} ms of work a frame, {gap:.1f} ms between frames")
        print(f"12 assisted beats: {assisted(page):.0f} ms")
        seconds, first = whole_map(page)
        print(f"map of 20 x 20: {seconds:.1f} s, first cell after {first:.1f} s")
        page.driver.quit()


if __name__ == "__main__":
    parser(__doc__).parse_args()
    run()
