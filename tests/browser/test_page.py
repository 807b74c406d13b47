"""What people do with the page: every control, files dropped, links, take-aways, accessibility, pictures of views."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lab_page import BENCH, Page

from tubular_dea.cli import main
from tubular_dea.identify.records.data import read_folder
from tubular_dea.lab.opened import closed_loop
from tubular_dea.lab.page import write
from tubular_dea.model.effect import with_effects
from tubular_dea.plants.saved import load
from tubular_dea.plants.tube import PLANT

VIEWS = ("tube", "heart", "data")
WHOLE = {"n_layers", "beats", "elements", "premature_action"}
AXE_TAGS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"]


def test_the_page_is_small_and_carries_its_licences(lab_file: Path) -> None:
    text = lab_file.read_text(encoding="utf-8")
    assert len(text.encode()) <= 1_500_000
    assert "Leon Sorokin" in text and "http-equiv" not in text


@pytest.mark.long
@pytest.mark.parametrize("view", VIEWS)
def test_every_control_can_be_used(page: Page, view: str) -> None:
    """Each range, number, choice, box and button moves, and nothing is logged (the fixture looks)."""
    page.show(view)
    page.run("for (const d of document.querySelectorAll('details')) d.open = true;")
    counted = page.run(
        """
        const root = document.getElementById(`view-${given[0]}`), seen = {};
        const tell = (element, kind) => element.dispatchEvent(new Event(kind, { bubbles: true }));
        for (const element of [...root.querySelectorAll("input, select")]) {
          if (!element.isConnected || element.type === "file") continue;
          seen[element.type] = (seen[element.type] ?? 0) + 1;
          if (element.type === "range") { for (const v of [120, 500]) { element.value = v; tell(element, "input"); } }
          else if (element.type === "number") {
            for (const v of ["", "-1e30"]) { element.value = v; tell(element, "input"); }
            tell(element, "blur");
          }
          else if (element.type === "checkbox") { element.click(); element.click(); }
          else for (const option of [...element.options]) { element.value = option.value; tell(element, "change"); }
          await new Promise((r) => requestAnimationFrame(r));
        }
        for (const button of [...root.querySelectorAll("button")]) {
          if (!button.isConnected || /csv|png|map-start/i.test(button.id)) continue;
          seen.button = (seen.button ?? 0) + 1;
          button.click();
        }
        await new Promise((r) => setTimeout(r, 400));
        return seen;
    """,
        view,
    )
    assert counted["range"] > 10 and counted["button"] > 5, counted


def test_values_out_of_bounds_are_refused_in_words(page: Page) -> None:
    told = page.run("""
        const number = document.querySelector("#view-tube input[data-name=eps_r]");
        number.value = "-3";
        number.dispatchEvent(new Event("input", { bubbles: true }));
        const problem = number.closest(".field").querySelector(".problem");
        return [number.getAttribute("aria-invalid"), problem.textContent, lab.state.tube.set.eps_r ?? null];
    """)
    assert told[0] == "true" and told[1] == "expected at least 1" and told[2] is None


def typed(page: Page, number: str, text: str, end: str = "\ue004") -> list[str]:
    """What stands in a field of this id once `text` is typed over it, after Tab (or `end`), and what is said there."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    page.run("document.getElementById(given[0]).focus();", number)
    keys = ActionChains(page.driver).key_down(Keys.CONTROL).send_keys("a").key_up(Keys.CONTROL)
    keys.send_keys(text or Keys.DELETE).perform()
    look = (
        "const n = document.getElementById(given[0]), said = document.getElementById(`${given[0]}-problem`);"
        "return [n.value, said.hidden ? '' : said.textContent];"
    )
    there = page.run(look, number)
    ActionChains(page.driver).send_keys(end).perform()
    return [there[0], *page.run(look, number)]


def the_field(page: Page, name: str, place: int = 0) -> str:
    return page.run(f"return document.querySelectorAll('#main input[data-name={name}]')[{place}].id;")


@pytest.mark.long
@pytest.mark.parametrize("shown", ["tube hand", "tube step", "tube ramp", "tube beat", "heart", "data"])
def test_a_decimal_number_is_typed_digit_by_digit_in_every_field(page: Page, shown: str) -> None:
    view, _, kind = shown.partition(" ")
    page.run("if (lab.T.playing) document.getElementById('play').click();")
    page.show(view)
    fields = page.run(
        """
        for (const name of given[1] ? ["pressure", "voltage"] : []) {
          const list = document.getElementById(`kind-${name}`);
          list.value = given[1];
          list.dispatchEvent(new Event("change", { bubbles: true }));
        }
        const view = document.getElementById(`view-${given[0]}`);
        for (const d of view.querySelectorAll("details")) d.open = !given[1] || given[1] === "step";
        await new Promise((r) => setTimeout(r, 100));
        const there = [...view.querySelectorAll("input[type=number]")].filter((n) => n.checkVisibility());
        return there.map((n) => [n.id, n.dataset.name, Number(n.value)]);
    """,
        view,
        kind,
    )
    assert len(fields) >= 2
    for number, name, value in fields:
        parts = [f"{value * part:.4g}" for part in (0.985, 1.015)] if value else ["0.25"]
        tried = ["8", "3", "1"] if name in WHOLE else [text if "." in text else f"{text}.25" for text in parts]
        told: list[list[str]] = []  # one of them may be beyond a bound, and is then refused as a whole
        while not told or (told[-1][2] and len(told) < len(tried)):
            told.append(typed(page, number, tried[len(told)]))
        text = tried[len(told) - 1]
        assert told[-1] == [text, f"{float(text):.7g}", ""], (name, told)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "place", "text", "kept", "words"),
    [
        ("stop", 0, "-3", "5", "-3 s: expected 0.1 to 600 s; 5 s is kept"),
        ("stop", 0, "", "5", "expected a number; 5 s is kept"),
        ("stop", 0, "1e9", "5", "1e9 s: expected 0.1 to 600 s; 5 s is kept"),
        ("pressure", 0, "9000", "0", "9000 mmHg: expected -750.064 to 750.064 mmHg; 0 mmHg is kept"),
        ("voltage", 1, "-5", "-5", "expected 0 kV or more; the tube answers to its square, as to 5 kV"),
        ("C_1", 0, "-1", "333.056", "-1 kPa: expected at least 0.001 kPa; 333.056 kPa is kept"),
    ],
)
@pytest.mark.parametrize("end", ["\ue004", "\ue007"], ids=["Tab", "Enter"])
def test_nonsense_is_answered_beside_its_field_and_the_last_value_kept(
    page: Page, name: str, place: int, text: str, kept: str, words: str, end: str
) -> None:
    field = the_field(page, name, place)
    assert typed(page, field, text, end)[1:] == [kept, words]
    page.run("lab.compute();")
    assert page.run("return [lab.T.problem, lab.T.result.stop];") == ["", 5]
    assert typed(page, field, kept.lstrip("-"))[1:] == [kept.lstrip("-"), ""]  # a good one is answered by nothing


def test_a_run_that_cannot_be_made_is_not_shown_as_new(page: Page) -> None:
    typed(page, the_field(page, "stop"), "1.5")
    page.wait("lab.T.refused")
    told = "return [document.querySelector('#view-tube [role=alert]').textContent, lab.T.stage.className];"
    said, looks = page.run(told)
    assert said.startswith("voltage: the step is from 2 to 4 s; expected it to") and "1.5 s" in said
    assert "What is shown is the last run that could be made" in said and "stale" in looks
    typed(page, the_field(page, "stop"), "6")
    page.wait("!lab.T.refused && !lab.T.stale")
    assert page.run(told) == ["", "stage"]


def test_what_is_left_of_a_record_has_a_unit_that_suits_its_size(page: Page) -> None:
    told = page.run(
        "const q = { name: 'position', unit: 'm', shown: 'm', factor: 1 };"
        "return [1e-5, 0.01, 2].map((size) => lab.fineUnit(q, size).shown);"
    )
    assert told == ["um", "mm", "m"]
    assert "Ctrl+Alt+1, 2, 3: views" in page.run("return document.querySelector('footer').textContent;")


def test_a_tube_that_runs_away_says_so_and_steps_back(page: Page) -> None:
    told = page.run("""
        lab.change("tube", (s) => { s.tube.inputs.voltage.high = 8; s.tube.inputs.pressure.high = 120; });
        await new Promise((r) => setTimeout(r, 200));
        const alert = document.querySelector("#view-tube [role=alert]"), text = alert.textContent;
        document.getElementById("undo-burst").click();
        await new Promise((r) => setTimeout(r, 200));
        return [text, alert.textContent, lab.state.tube.inputs.voltage.high];
    """)
    assert "runs away" in told[0] and told[1] == "" and 3 < told[2] < 8


def test_a_gap_in_a_curve_is_no_line(page: Page) -> None:
    """The stable branch ends at the fold; no chord leads on beside the dashed one."""
    drawn = page.run("""
        const plot = lab.T.curvePlot, calls = [];
        const ctx = new Proxy({}, { get: (_, name) => (x) => { if (/To$/.test(name)) calls.push([name, x]); } });
        plot.curves = [{ colour: "--c3", x: [1, 2, 3, 4, 5], y: [1, 2, NaN, 4, 5] }];
        plot.drawCurves({ ctx, bbox: {}, valToPos: (value) => value });
        return calls;
    """)
    assert drawn == [["moveTo", 1], ["lineTo", 2], ["moveTo", 4], ["lineTo", 5]]


def test_long_names_numbers_and_lines_look_as_they_are(page: Page) -> None:
    """A solid loop has a solid key, a long number fits its field, and names break between their words."""
    page.show("heart")
    assert page.run("return [...document.querySelectorAll('#plot-loop .key i')].map((i) => i.className);") == [
        "dash",
        "",
    ]
    page.show("tube")
    told = page.run("""
        lab.change("tube", (s) => { s.tube.set.C_2 = -32.03177; });
        await new Promise((r) => setTimeout(r, 100));
        const number = document.querySelector("#view-tube input[data-name=C_2]");
        const label = document.querySelector(`label[for="${number.id}"]`);
        return [number.value, number.scrollWidth - number.clientWidth, label.innerHTML];
    """)
    assert told == ["-32.03177", 0, "C_<wbr>2"]


@pytest.mark.parametrize("width", [1200, 400])
def test_labels_break_between_words_only(page: Page, width: int) -> None:
    """No two letters of a word of a label are in different lines."""
    page.size(width)
    page.show("heart")
    labels, broken = page.run("""
        for (const d of document.querySelectorAll("#view-heart .side details")) d.open = true;
        const top = (node, i) => {
          const range = document.createRange();
          range.setStart(node, i);
          range.setEnd(node, i + 1);
          return range.getBoundingClientRect().top;
        };
        const labels = [...document.querySelectorAll("#view-heart .field label")];
        const letters = (node) => [...node.data ?? ""].map((letter, i) => [letter, top(node, i)]);
        const broken = (label) => [...label.childNodes].flatMap(letters).some(([letter, y], k, all) => {
          const [before, above] = k ? all[k - 1] : [" ", y];
          return letter !== " " && before !== " " && Math.abs(y - above) > 5;
        });
        return [labels.length, labels.filter(broken).map((label) => label.textContent)];
    """)
    page.size(1280)
    assert labels > 30 and broken == []


def test_by_hand_the_record_follows_the_sliders_and_can_be_taken_back(page: Page) -> None:
    page.run("""
        for (const name of ["pressure", "voltage"]) lab.change("tube", (s) => { s.tube.inputs[name].kind = "hand"; });
        lab.change("tube", (s) => { s.tube.inputs.pressure.level = 90; });
    """)
    page.wait("lab.state.tube.record && lab.state.tube.record.time.at(-1) > 1")
    page.run("lab.change('tube', (s) => { s.tube.inputs.voltage.level = 8.5; s.tube.inputs.pressure.level = 115; });")
    page.wait("document.getElementById('undo-burst')")
    page.run("document.getElementById('undo-burst').click(); await new Promise((r) => setTimeout(r, 200));")
    assert page.run("return document.querySelector('#view-tube [role=alert]').textContent;") == ""
    assert page.run("return lab.state.tube.inputs.voltage.level;") < 8.5


STATE = {
    "view": "heart",
    "si": True,
    "theme": "dark",
    "tube": {"inputs": {"pressure": {"kind": "beat", "high": 117.5}}, "set": {"C_1": 321.5}, "stop": 7},
    "heart": {
        "patient": "stiff",
        "rhythm": "bigeminy",
        "beats": 14,
        "set": {"heart.R": 1.1, "scheduler.voltage_on": 4.75},
    },
    "data": {"on": ["sensor_lag"], "set": {"eps_r": 2.65}, "shown": "03_step_6kV"},
}


def test_a_link_holds_the_whole_state(page: Page) -> None:
    there = page.run(
        "lab.adopt(lab.merged(lab.defaults(), given[0], ''));return [lab.link(), JSON.stringify(lab.state)];", STATE
    )
    page.wait("lab.H.result")
    page.open(there[0])
    assert page.run("return JSON.stringify(lab.state);") == there[1]
    assert page.run("return document.getElementById('view-heart').hidden;") is False


@pytest.mark.parametrize(
    "fragment", ["#nothing", "#s=%%%", "#s=e30x", "#s=eyJ2aWV3IjoibW9vbiJ9", "#s=eyJ0dWJlIjp7InNldCI6eyJDXzEiOi01fX19"]
)
def test_a_broken_link_opens_the_default_with_a_notice(page: Page, fragment: str) -> None:
    page.open(fragment)
    said = page.run("return document.getElementById('notice').textContent;")
    assert "cannot be read" in said and "null" not in said
    assert page.run("return JSON.stringify(lab.state) === JSON.stringify(lab.defaults());")


def test_files_are_dropped_and_refused(page: Page) -> None:
    page.show("data")
    good = (BENCH / "03_step_6kV.csv").read_text()
    page.run(
        """
        const transfer = new DataTransfer();
        transfer.items.add(new File([given[0]], "dropped.csv"));
        transfer.items.add(new File([given[0].replace("pressure [Pa]", "pressure [V]")], "wrong.csv"));
        const drop = new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true });
        document.getElementById("drop").dispatchEvent(drop);
        await new Promise((r) => setTimeout(r, 300));
    """,
        good,
    )
    page.wait("lab.D.runs && lab.D.runs.length === 7")
    assert page.run("return lab.D.experiments.map((e) => e.name);").count("dropped") == 1
    told = page.run("return document.querySelector('#view-data [role=alert]').textContent;")
    assert told.startswith("wrong.csv, line 1") and "expected a unit like 'Pa'" in told


def test_an_effect_changes_what_is_left(page: Page) -> None:
    page.show("data")
    page.wait("lab.D.runs")
    before = page.run("return document.querySelector('#view-data [role=status]').textContent;")
    page.run("document.getElementById('effect-pressure_offset').click();")
    page.wait("lab.D.before && !lab.D.same && !lab.D.latest.busy")
    after = page.run("return document.querySelector('#view-data [role=status]').textContent;")
    assert before.startswith("All together: RMSE") and "before" in after


def test_pictures_tables_and_the_model_can_be_saved(page: Page, downloads: Path) -> None:
    page.run("lab.change('tube', (s) => { s.tube.set.C_1 = 350; }); await new Promise((r) => setTimeout(r, 200));")
    page.run(
        "for (const id of ['pressure-csv', 'pressure-png', 'curve-csv', 'all-csv', 'save-model']) {"
        " document.getElementById(id).click(); await new Promise((r) => setTimeout(r, 150)); }"
    )
    names = ("pressure.csv", "pressure.png", "curve.csv", "tube.csv", "model.json")
    for _ in range(100):
        if all((downloads / name).exists() for name in names):
            break
        page.run("await new Promise((r) => setTimeout(r, 100));")
    assert (downloads / "pressure.png").read_bytes().startswith(b"\x89PNG")
    assert (downloads / "pressure.csv").read_text().startswith("time [s],pressure [Pa],snap-through [Pa]\n0,0,")
    assert (downloads / "curve.csv").read_text().startswith("curve,lambda_2 [1],pressure [Pa]\nstable,")
    assert load(downloads / "model.json").parameter_values()["C_1"] == 350e3
    assert json.loads((downloads / "model.json").read_text())["effects"] == []


def test_a_map_is_computed_with_progress_and_adopted(page: Page) -> None:
    page.show("heart")
    page.run("lab.change('heart', (s) => { s.heart.beats = 6; });")
    page.run("document.getElementById('map-start').click();")
    page.wait("lab.H.map.cells && lab.H.map.cells.size > 5")
    assert page.run("return document.getElementById('map-progress').value;") > 0
    page.run("document.getElementById('map-start').click();")
    page.wait("!lab.H.map.going")
    page.run("""
        for (const key of ["ArrowUp", "ArrowRight", "Enter"])
          lab.H.map.canvas.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
    """)
    assert page.run("return lab.state.heart.set['scheduler.voltage_on'];") > 5.5


def test_keys_alone_reach_views_handles_and_play(page: Page) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    ActionChains(page.driver).send_keys(" ").perform()
    assert page.run("return lab.T.playing;") is False
    page.run("document.getElementById('tab-tube').focus();")
    ActionChains(page.driver).send_keys(Keys.ARROW_RIGHT).perform()
    page.wait("lab.state.view === 'heart' && lab.H.result")
    page.run("document.getElementById('handle-on').focus();")
    ActionChains(page.driver).send_keys(Keys.ARROW_LEFT * 3).perform()
    assert page.run("return lab.state.heart.set['scheduler.on_fraction'];") == pytest.approx(0.035)


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("view", VIEWS)
def test_axe_finds_nothing(page: Page, view: str, theme: str) -> None:
    axe = pytest.importorskip("axe_core_python", reason="the test extra brings axe-core-python")
    page.run(f"lab.change('theme', (s) => {{ s.theme = '{theme}'; }});")
    page.show(view)
    page.run("for (const d of document.querySelectorAll('details')) d.open = true;")
    page.driver.execute_script((Path(axe.__file__).parent / "axe.min.js").read_text(encoding="utf-8"))
    found = page.run(
        "return (await axe.run(document, { runOnly: given[0] })).violations"
        ".map((v) => [v.id, v.help, v.nodes.slice(0, 3).map((n) => n.html)]);",
        AXE_TAGS,
    )
    assert found == []


@pytest.mark.long
@pytest.mark.parametrize("view", VIEWS)
def test_nothing_is_wider_than_a_phone(page: Page, view: str) -> None:
    """With everything open, at every control's ends, and before plots drawn for a wide window are drawn anew."""
    page.show(view)
    page.size(390)
    wider = page.run(
        """
        const root = document.getElementById(`view-${given[0]}`), wider = [];
        const tell = (element, kind) => element.dispatchEvent(new Event(kind, { bubbles: true }));
        const look = async (after) => {
          if (document.documentElement.scrollWidth > 390) wider.push(after);
          await new Promise((r) => requestAnimationFrame(r));
          if (document.documentElement.scrollWidth > 390) wider.push(`${after}, a frame later`);
        };
        for (const d of document.querySelectorAll("details")) d.open = true;
        await look("all open");
        for (const element of [...root.querySelectorAll("input[type=range], select")]) {
          if (!element.isConnected) continue;
          const values = element.options ? [...element.options].map((o) => o.value) : [0, 1000];
          for (const value of values) {
            element.value = value;
            tell(element, element.options ? "change" : "input");
            await look(`${element.id} = ${value}`);
          }
        }
        return wider;
    """,
        view,
    )
    assert wider == []


@pytest.mark.long
@pytest.mark.parametrize(("width", "theme"), [(1280, "light"), (1280, "dark"), (390, "light")])
@pytest.mark.parametrize("view", VIEWS)
def test_pictures_of_each_view(page: Page, view: str, width: int, theme: str) -> None:
    page.run(f"lab.change('theme', (s) => {{ s.theme = '{theme}'; }});")
    page.size(width)
    page.show(view)
    assert page.run("return document.documentElement.scrollWidth;") <= width  # nothing has to be scrolled sideways
    assert page.shot(f"{view}-{width}-{theme}", width).stat().st_size > 20_000


def test_a_closed_loop_page_switches_before_and_after(browser: Page, tmp_path: Path) -> None:
    lag = PLANT.own["electrode_resistance"]
    found = with_effects(PLANT.model, [lag.id], PLANT.own).with_values({**lag.typical, "C_1": 320e3})
    content = closed_loop(
        read_folder(BENCH, PLANT), found, {"C_1": 310e3}, {"model": "closed/model.json", "data": "b"}, {}
    )
    own = browser.path
    try:
        browser.path = write(tmp_path / "lab.html", content)
        browser.open()
        browser.wait("lab.D.runs && lab.D.before")
        assert browser.run("return lab.state.view;") == "data"
        chosen = "return [lab.dataValues().C_1, lab.dataValues().electrode_share];"
        assert browser.run(chosen) == [320e3, 1]
        browser.run("""
            const list = document.getElementById("setting-data");
            list.value = list.options[1].value;
            list.dispatchEvent(new Event("change", { bubbles: true }));
        """)
        assert browser.run(chosen) == [310e3, 0]
        browser.show("heart")  # with the effect inside the assisted loop
        assert browser.run("return lab.H.result.with.reason;") == ""
        assert "--model closed/model.json" in browser.run("return lab.command();")
        assert browser.messages() == [] and browser.requests() == []
    finally:
        browser.path = own


def test_the_handbook_fits_a_phone_and_clips_no_column_on_a_desktop(browser: Page, tmp_path: Path) -> None:
    path = tmp_path / "handbook.html"
    assert main(["handbook", "--out", str(path)]) == 0
    browser.requests()  # those of earlier tests
    browser.driver.get(path.as_uri())
    wide = "const e = document.documentElement; return e.scrollWidth;"
    clipped = "[...document.querySelectorAll('.wide')].filter((b) => b.scrollWidth > b.clientWidth + 1).length"
    try:
        browser.size(400)
        assert browser.run(wide) <= 400
        browser.size(1200)
        assert browser.run(wide) <= 1200
        assert browser.run(f"return {clipped};") == 0
        assert browser.requests() == [path.as_uri()]
    finally:
        browser.size(1280)
        browser.close()


def test_without_webassembly_the_page_says_so(browser: Page) -> None:
    browser.driver.execute_cdp_cmd("Page.enable", {})
    made = browser.driver.execute_cdp_cmd(
        "Page.addScriptToEvaluateOnNewDocument", {"source": "delete window.WebAssembly;"}
    )
    try:
        browser.driver.get("about:blank")
        browser.driver.get(browser.path.as_uri())
        assert "no WebAssembly" in browser.run("return document.getElementById('main').textContent;")
    finally:
        browser.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", made)
    assert browser.messages() == []
