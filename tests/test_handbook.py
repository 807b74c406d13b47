"""The handbook: everything that is declared stands on it, and it opens without a network."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
from lxml import html

import tubular_dea
from tubular_dea.cli import main
from tubular_dea.commands import COMMANDS
from tubular_dea.docstrings import paragraph, rendered, signature, summary, without
from tubular_dea.emit import tables
from tubular_dea.emit.line_breaks import ROOM
from tubular_dea.laws import laws
from tubular_dea.model.dea import tubular_dea as tube
from tubular_dea.model.declare import Model
from tubular_dea.plants import aorta
from tubular_dea.plants import tube as tube_plant
from tubular_dea.plants.effects import catalogue
from tubular_dea.plants.plant import Plant

TANKS = Path(__file__).parents[1] / "cosim_examples" / "plants" / "cascaded_tanks.py"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> html.HtmlElement:
    """The page of what the package has."""
    path = tmp_path_factory.mktemp("handbook") / "handbook.html"
    assert main(["handbook", "--out", str(path)]) == 0
    return html.fromstring(path.read_text(encoding="utf-8"))


def entries(page: html.HtmlElement, section: str) -> dict[str, html.HtmlElement]:
    (found,) = [s for s in page.iter("section") if s.findtext("h2") == section]
    return {article.findtext("h3"): article for article in found.iter("article")}


def test_everything_that_is_declared_has_an_entry(page: html.HtmlElement) -> None:
    models = {"TubularDEA", "AorticAfterload", "AorticWindkessel", "HeartbeatScheduler", "TubeController"}
    assert set(entries(page, "Models")) == models
    assert list(entries(page, "What TubularDEA may lack")) == list(catalogue())
    assert list(entries(page, "What AorticAfterload may lack")) == list(aorta.PLANT.catalogue)
    assert list(entries(page, "Laws")) == list(laws())
    assert sorted(entries(page, "Python")) == sorted(tubular_dea.__all__)
    assert list(entries(page, "Commands")) == list(COMMANDS)


def test_no_entry_is_empty_and_every_link_leads_somewhere(page: html.HtmlElement) -> None:
    for article in page.iter("article"):
        assert len(article.text_content()) > 60, article.findtext("h3")
    there = [element.get("id") for element in page.iter() if element.get("id")]
    assert len(there) == len(set(there))
    links = [link.get("href") for link in page.iter("a")]
    assert {link.removeprefix("#") for link in links} == set(there)
    assert not page.xpath("//@src | //link | //script")
    assert page.xpath("//meta[@name='viewport']/@content") == ["width=device-width, initial-scale=1"]
    assert all(table.getparent().get("class") == "wide" for table in page.iter("table"))  # scrolls in its own box


def test_equations_parameters_and_options_are_there(page: html.HtmlElement) -> None:
    model = entries(page, "Models")["TubularDEA"]
    text = model.text_content()
    assert len(list(model.iter("math"))) == len(tube().definitions) + len(tube().states)
    for parameter in tube().parameters:
        assert parameter.quantity.description in text
    slew = entries(page, "What TubularDEA may lack")["amplifier_slew"]
    assert "Trek" in slew.text_content()
    assert len(list(slew.iter("math"))) >= 4
    late = entries(page, "What TubularDEA may lack")["pressure_delay"].text_content()
    assert "delayed_pressure=pressure(-pressure_delay+time)" in late.replace(" ", "")
    assert "--optimise" in entries(page, "Commands")["assist"].text_content()


def test_wide_equations_are_broken_into_lines(page: html.HtmlElement) -> None:
    rows = [row for row in entries(page, "Models")["TubularDEA"].iter("tr") if list(row.iter("math"))]
    equations = {row[0].text_content(): row for row in rows}
    assert list(equations["tube_volume"].iter("mtable")) and not list(equations["lambda_1"].iter("mtable"))
    for name in ("tube_volume", "current"):
        lines = [cell for cell in equations[name].iter("mtd") if not list(cell.iter("mtable"))]
        assert len(lines) >= 3
        assert max(len(line.text_content()) for line in lines) < ROOM


def test_breaking_lines_changes_no_equation(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same names, numbers and signs in the same order, in every model and effect."""
    changed = [after for plant in (tube_plant.PLANT, aorta.PLANT) for after in effects_of(plant)]
    broken = [html.fromstring(tables.body(model)) for model in changed]
    assert sum(bool(list(page.iter("mtable"))) for page in broken) > 20
    monkeypatch.setattr(tables, "break_lines", lambda equation: None)
    for page, model in zip(broken, changed, strict=True):
        flat = html.fromstring(tables.body(model))
        assert [m.text_content() for m in page.iter("math")] == [m.text_content() for m in flat.iter("math")]


def effects_of(plant: Plant) -> list[Model]:
    return [effect(plant.model) for effect in plant.catalogue.values()]


def test_off_values_and_usual_sizes(page: html.HtmlElement) -> None:
    (section,) = [s for s in page.iter("section") if s.findtext("h2") == "What TubularDEA may lack"]
    rows = {row[0].text_content(): row.text_content() for row in section.find(".//table").iter("tr")}
    assert "electrode_share 1" in rows["electrode_resistance"]
    assert "tau_e 10 ms" in rows["electrode_resistance"]
    assert "d(tau V_1)/dt = V - V_1" in rows["electrode_resistance"]


def test_numpydoc_sections_lists_and_literal_blocks() -> None:
    text = """A thing, `made` of ``parts``::

        drawing <--

    1. First
       and more.
    2. Second.

    Parameters
    ----------
    size : float
        How large [m].

        Not negative.
    *rest
        What else.

    Examples
    --------
    >>> 1 < 2
    True
    """
    page = html.fromstring(f"<div>{rendered(text)}</div>")
    assert [c.text for c in page.iter("code")] == ["made", "parts"]
    assert [p.text for p in page.iter("pre")] == ["drawing <--", ">>> 1 < 2\nTrue"]
    assert [i.text for i in page.iter("li")] == ["First and more.", "Second."]
    assert [t.text for t in page.iter("dt")] == ["size : float", "*rest"]
    assert [d.text_content() for d in page.iter("dd")] == ["How large [m].Not negative.", "What else."]
    assert summary(text) == "A thing, `made` of ``parts``::"


def test_what_is_written_for_readers_of_the_source_is_not_on_pages(page: html.HtmlElement) -> None:
    models = entries(page, "Models")
    pages = [*models.values(), html.fromstring(tables.page(tube())), html.fromstring(tables.page(aorta.PLANT.model))]
    for shown in pages:
        text = shown.text_content()
        assert not any(word in text for word in ("`", "PARAMETERS", "Usage", "import ", "`tubular_dea` below"))
        assert "In a tool that reads FMUs: connect" in text
    assert "connect pressure [Pa] and voltage [V], give fixed" in models["TubularDEA"].text_content()
    listed = [item.text_content() for item in models["AorticWindkessel"].iter("li")]
    assert len(listed) == 7 and listed[0].startswith("elastance E = ") and listed[-1].endswith("smooth valves.")
    assert not [p for p in page.iter("p") if p.text_content().startswith("* ")]


def test_a_usage_is_left_out_with_its_code_and_nothing_else() -> None:
    text = "What.\n\nUsage::\n\n    a()\n\n    b()\n\nSource: none.\n\n* One\n  thing.\n* Another."
    assert without(text, "Usage") == "What.\n\nSource: none.\n\n* One\n  thing.\n* Another."
    assert [i.text for i in html.fromstring(f"<div>{rendered(text)}</div>").iter("li")] == ["One thing.", "Another."]


def test_paragraphs_and_calls() -> None:
    text = "What.\n\nEquations: a = b\nand c: d.\n\nSource: none."
    assert paragraph(text, "Equation") == "a = b and c: d."
    assert paragraph(text, "Typical") == ""

    def called(self: object, a: argparse.Namespace, b: str = "x") -> list[int]: ...

    assert signature("f", called) == "f(a: argparse.Namespace, b: str = 'x') -> list[int]"


@pytest.mark.parametrize("command", ["handbook", "lab", "atlas"])
def test_a_folder_is_no_page(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, text = tmp_path / "folder.html", tmp_path / "x.txt"
    folder.mkdir()
    text.write_text("")
    for out in (folder, text):
        assert main([command, "--out", str(out)]) == 2
        assert f"--out {out}: expected the name of a page" in capsys.readouterr().err


def test_a_plant_of_ones_own_has_a_page_of_its_own() -> None:
    page = html.fromstring(tubular_dea.handbook_page(TANKS).html)
    assert list(entries(page, "Models")) == ["CascadedTanks"]
    assert "power(outflow_2)" in entries(page, "What CascadedTanks may lack")
    assert [s.findtext("h2") for s in page.iter("section")] == [
        "Models",
        "What CascadedTanks may lack",
        "Laws",
        "Python",
    ]


def test_bounds_end_without_a_semicolon(page: html.HtmlElement) -> None:
    allowed = [row[2].text for row in page.iter("tr") if len(row) == 5 and row[2].text]
    assert "fixed" in allowed and not [text for text in allowed if text.rstrip().endswith(";")]
