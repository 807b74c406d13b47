"""Every XML file that is written is valid by the standards' own schemas, over every model; and what hosts trip over."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import fmpy
import fmpy.ssp
import pytest
from lxml import etree

from test_plain_models import chain, one_state, static_law
from tubular_dea.cosim.heart_assist import models
from tubular_dea.emit import model_description
from tubular_dea.export import ssp
from tubular_dea.model.declare import Model
from tubular_dea.plants import aorta
from tubular_dea.plants.effects import catalogue, with_effects

FMI = Path(fmpy.__file__).parent / "schema"
SSP = Path(fmpy.ssp.__file__).parent / "schema"
SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"


def everything() -> dict[str, Model]:
    """The parts of the assisted heart, the tube with every effect, and models of no plant at all."""
    parts = models()
    effects = {"all effects": with_effects(parts["tube"], tuple(catalogue()))}
    return (
        parts | effects | {"afterload": aorta.PLANT.model, "static": static_law(), "one": one_state(), "chain": chain()}
    )


MODELS = everything()
FILES: dict[str, tuple[Callable[[Model], str], str]] = {
    "fmi2": (model_description.fmi2, "fmi2/fmi2ModelDescription.xsd"),
    "python": (lambda model: model_description.fmi2(model, "python"), "fmi2/fmi2ModelDescription.xsd"),
    "sources": (lambda model: model_description.fmi2(model, "native", ("model.c",)), "fmi2/fmi2ModelDescription.xsd"),
    "fmi3": (model_description.fmi3, "fmi3/fmi3ModelDescription.xsd"),
    "build": (lambda model: model_description.build_description(model, ("a.c",)), "fmi3/fmi3BuildDescription.xsd"),
    "terminals": (model_description.terminals, "fmi3/fmi3TerminalsAndIcons.xsd"),
}


def check(text: str, schema: Path) -> etree._Element:
    root = etree.fromstring(text.encode())
    etree.XMLSchema(file=str(schema)).assertValid(root)
    return root


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("name", MODELS)
def test_fmi(name: str, file: str) -> None:
    write, schema = FILES[file]
    check(write(MODELS[name]), FMI / schema)


@pytest.mark.parametrize("name", MODELS)
def test_references_begin_at_one_and_no_dependency_is_the_time(name: str) -> None:
    """OMSimulator takes reference 0 for none and refuses the time among the dependencies."""
    root = check(model_description.fmi3(MODELS[name]), FMI / "fmi3/fmi3ModelDescription.xsd")
    references = [int(v.get("valueReference")) for v in root.find("ModelVariables")]
    assert references == list(range(1, len(references) + 1))
    (time,) = (v for v in root.find("ModelVariables") if v.get("causality") == "independent")
    for unknown in root.find("ModelStructure"):
        assert time.get("valueReference") not in unknown.get("dependencies").split()


def test_terminals_are_there_only_with_content() -> None:
    found = {
        name: etree.fromstring(model_description.terminals(m).encode()).find("Terminals") is not None
        for name, m in MODELS.items()
    }
    assert found == {name: name in ("tube", "all effects") for name in MODELS}


def test_ssp() -> None:
    """Both files of the archive; and what OMSimulator needs to open a system, where the schema has room for it."""
    parts = models()
    fmus = {name: Path(f"{model.name}.fmu") for name, model in parts.items()}
    wires = [("tube.tube_flow", "heart.tube_flow"), ("heart.aortic_pressure", "tube.pressure")]
    text = ssp.description("HeartAssist", parts, fmus, wires, {"tube.C_1": 3.3e5, "tube.n_layers": 8.0}, 4.0)
    root = check(text, SSP / "SystemStructureDescription.xsd")
    (step,) = root.find(f"{SSD}System").iter("{*}FixedStepMaster")
    assert step.attrib == {
        "description": "oms-ma",
        "stepSize": "0.001",
        "absoluteTolerance": "1e-6",
        "relativeTolerance": "1e-6",
    }
    assert [e.tag.split("}")[1] for e in step.iterancestors()][:4] == [
        "SimulationInformation",
        "Annotations",
        "Annotation",
        "Annotations",
    ]
    values = ssp.parameter_file(parts, {"tube.C_1": 3.3e5, "tube.n_layers": 8.0, "tube.start_at_equilibrium": 1.0})
    check(values, SSP / "SystemStructureParameterValues.xsd")


def test_current_says_what_model_exchange_lacks() -> None:
    variables = etree.fromstring(model_description.fmi2(MODELS["tube"]).encode()).find("ModelVariables")
    texts = {v.get("name"): v.get("description") for v in variables}
    assert "in model exchange, where hosts give no rate of voltage, as if it were held" in texts["current"]
    assert sum("in model exchange" in text for text in texts.values()) == 1
