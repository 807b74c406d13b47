"""System Structure and Parameterization 1.0: FMUs, their connections and parameter values in one archive.

The parameter values are inside the components' bindings, where ecos (as the parameter set "start") and libcosim find
them; and once more, under their full names, in `resources/start.ssv` for tools that are handed one set, as FMPy is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from ..files import write_atomically
from ..model import units
from ..model.declare import Model, Quantity
from .package import archive

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
MASTER = {"description": "oms-ma", "stepSize": "0.001", "absoluteTolerance": "1e-6", "relativeTolerance": "1e-6"}

PARAMETER_SET = "start"


def ssp(
    name: str,
    models: Mapping[str, Model],
    fmus: Mapping[str, Path],
    connections: Sequence[tuple[str, str]],
    parameters: Mapping[str, float],
    stop: float,
    path: Path,
) -> Path:
    """Write the archive. `models` and `fmus` by part, `connections` and `parameters` (SI units) by "part.variable"."""
    files = {f"resources/{fmus[part].name}": fmus[part].read_bytes() for part in models}
    files["resources/start.ssv"] = parameter_file(models, parameters).encode()
    files["SystemStructure.ssd"] = description(name, models, fmus, connections, parameters, stop).encode()
    return write_atomically(path, archive(files))


def description(
    name: str,
    models: Mapping[str, Model],
    fmus: Mapping[str, Path],
    connections: Sequence[tuple[str, str]],
    parameters: Mapping[str, float],
    stop: float,
) -> str:
    """SystemStructure.ssd."""
    spaces = {f"xmlns:{prefix}": uri for prefix, uri in NAMESPACES.items()}
    root = ET.Element("ssd:SystemStructureDescription", {"version": "1.0", "name": name} | spaces)
    system = ET.SubElement(root, "ssd:System", name=name)
    elements = ET.SubElement(system, "ssd:Elements")
    for part, model in models.items():
        _component(elements, part, model, fmus[part], parameters)
    wires = ET.SubElement(system, "ssd:Connections")
    for source, target in connections:
        (a, output), (b, into) = source.split(".", 1), target.split(".", 1)
        ET.SubElement(wires, "ssd:Connection", startElement=a, startConnector=output, endElement=b, endConnector=into)
    _how_to_step(system)
    _units(root, models)
    ET.SubElement(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(float(stop)))
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _how_to_step(system: ET.Element) -> None:
    """The master's step for OMSimulator, which opens no system without it; SSP itself has no place for that."""
    note = ET.SubElement(ET.SubElement(system, "ssd:Annotations"), "ssc:Annotation", type="org.openmodelica")
    information = ET.SubElement(ET.SubElement(note, "oms:Annotations"), "oms:SimulationInformation")
    ET.SubElement(information, "oms:FixedStepMaster", MASTER)


def _component(elements: ET.Element, part: str, model: Model, fmu: Path, parameters: Mapping[str, float]) -> None:
    component = ET.SubElement(
        elements, "ssd:Component", name=part, type="application/x-fmu-sharedlibrary", source=f"resources/{fmu.name}"
    )
    connectors = ET.SubElement(component, "ssd:Connectors")
    for kind, names in (("input", [q.name for q in model.inputs]), ("output", model.outputs)):
        for name in names:
            connector = ET.SubElement(connectors, "ssd:Connector", name=name, kind=kind)
            ET.SubElement(connector, "ssc:Real", unit=model.quantity(name).unit)
    values = {n.split(".", 1)[1]: v for n, v in parameters.items() if n.split(".", 1)[0] == part}
    if not values:
        return
    bindings = ET.SubElement(component, "ssd:ParameterBindings")
    binding = ET.SubElement(ET.SubElement(bindings, "ssd:ParameterBinding"), "ssd:ParameterValues")
    held = ET.SubElement(binding, "ssv:ParameterSet", version="1.0", name=PARAMETER_SET)
    group = ET.SubElement(held, "ssv:Parameters")
    for name, value in values.items():
        _value(ET.SubElement(group, "ssv:Parameter", name=name), model.quantity(name), value)


def parameter_file(models: Mapping[str, Model], parameters: Mapping[str, float]) -> str:
    """resources/start.ssv."""
    spaces = {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in ("ssv", "ssc")}
    root = ET.Element("ssv:ParameterSet", {"version": "1.0", "name": PARAMETER_SET} | spaces)
    group = ET.SubElement(root, "ssv:Parameters")
    for name, value in parameters.items():
        part, variable = name.split(".", 1)
        _value(ET.SubElement(group, "ssv:Parameter", name=name), models[part].quantity(variable), value)
    _units(root, models, "ssv:Units")
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _value(parameter: ET.Element, quantity: Quantity, value: float) -> None:
    if quantity.type == "Boolean":
        ET.SubElement(parameter, "ssv:Boolean", value="true" if value else "false")
    elif quantity.type == "Integer":
        ET.SubElement(parameter, "ssv:Integer", value=str(int(value)))
    else:
        ET.SubElement(parameter, "ssv:Real", value=repr(float(value)), unit=quantity.unit)


def _units(root: ET.Element, models: Mapping[str, Model], tag: str = "ssd:Units") -> None:
    used = sorted({q.unit for model in models.values() for q in model.quantities().values()})
    group = ET.SubElement(root, tag)
    for name in used:
        parsed = units.parse(name)
        exponents = {base: str(e) for base, e in zip(units.BASE, parsed.exponents, strict=True) if e}
        if parsed.factor != 1.0:
            exponents["factor"] = repr(float(parsed.factor))
        ET.SubElement(ET.SubElement(group, "ssc:Unit", name=name), "ssc:BaseUnit", exponents)
