"""The same page in Debian's firefox-esr, driven by WebDriver BiDi, which it speaks by itself."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from lab_page import SHOTS

from tubular_dea.kernel import Kernel
from tubular_dea.protocol import Protocol

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
PATIENCE = 90  # s


class Firefox:
    """One headless Firefox with one page. `events` are its messages and requests so far."""

    def __init__(self, folder: Path) -> None:
        websocket = pytest.importorskip("websocket", reason="selenium brings websocket-client")
        command = [str(FIREFOX), "--headless", "--no-remote", "--profile", str(folder), "--remote-debugging-port=0"]
        self.process = subprocess.Popen([*command, "about:blank"], stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        address = next(m[1] for m in map(re.compile(r"(ws://\S+)").search, self.process.stderr) if m)
        self.socket = websocket.create_connection(f"{address}/session", suppress_origin=True, timeout=PATIENCE)
        self.number, self.events = 0, []
        self.ask("session.new", capabilities={})
        self.ask("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        self.context = self.ask("browsingContext.getTree")["contexts"][0]["context"]

    def ask(self, method: str, **parameters: object) -> dict:
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self.socket.recv())
            if answer.get("id") == self.number:
                assert answer["type"] == "success", answer
                return answer["result"]
            self.events.append(answer)

    def run(self, body: str) -> object:
        """The value of a JavaScript function's body, through JSON."""
        expression = f"(async () => JSON.stringify(await (async () => {{ {body} }})() ?? null))()"
        found = self.ask("script.evaluate", expression=expression, awaitPromise=True, target={"context": self.context})
        assert found["type"] == "success", found
        return json.loads(found["result"]["value"])

    def until(self, condition: str) -> None:
        self.run(
            f"const begun = Date.now(); while (!({condition})) {{ if (Date.now() - begun > {PATIENCE}e3)"
            " throw new Error('waited in vain'); await new Promise((r) => setTimeout(r, 30)); }"
        )

    def close(self) -> None:
        self.socket.close()
        self.process.terminate()
        self.process.wait(PATIENCE)
        self.process.stderr.close()


@pytest.fixture
def firefox(tmp_path: Path) -> Iterator[Firefox]:
    if FIREFOX is None:
        pytest.skip("firefox is not installed (apt-get install firefox-esr)")
    browser = Firefox(tmp_path)
    yield browser
    browser.close()


def test_firefox_shows_and_computes_the_same(firefox: Firefox, lab_file: Path, kernel: Kernel) -> None:
    firefox.ask("browsingContext.navigate", context=firefox.context, url=lab_file.as_uri(), wait="complete")
    firefox.until("window.lab && lab.firstPlot")
    time, values, marks, pressure, voltage = firefox.run("""
        lab.T.playing = false;
        lab.compute();
        const { run, drive } = lab.T.result;
        const { pressure, voltage } = drive.inputs;
        return [run.time, run.values.lambda_2, drive.time, pressure, voltage].map((v) => Array.from(v));
    """)
    wanted = kernel.simulate(Protocol.of(marks, pressure=pressure, voltage=voltage), np.array(time))
    assert np.array_equal(wanted["lambda_2"], values)
    for view, ready in (("heart", "lab.H.result"), ("data", "lab.D.runs && lab.D.before"), ("tube", "true")):
        firefox.run(f"lab.change('view', (s) => {{ s.view = '{view}'; }});")
        firefox.until(ready)
        shot = firefox.ask("browsingContext.captureScreenshot", context=firefox.context)
        SHOTS.mkdir(parents=True, exist_ok=True)
        (SHOTS / f"{view}-firefox.png").write_bytes(base64.b64decode(shot["data"]))
    assert firefox.run("return lab.H.result.with.reason;") == ""
    said = [e["params"] for e in firefox.events if e.get("method") == "log.entryAdded"]
    urls = [e["params"]["request"]["url"] for e in firefox.events if e.get("method") == "network.beforeRequestSent"]
    assert said == []
    assert [u for u in urls if not u.startswith(("file:", "blob:", "data:", "about:"))] == []
