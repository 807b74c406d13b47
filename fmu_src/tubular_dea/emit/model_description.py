"""modelDescription.xml of FMI 2.0 and FMI 3.0, and the FMI 3 files beside it, from the variable table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from .. import __version__
from ..model import units
from ..model.declare import Model, Quantity
from .variables import Variable, guid, variables

LOG_CATEGORIES = {
    "logEvents": "Changes of mode",
    "logSolver": "Internal steps of each communication step",
    "logStatusWarning": "Calls that were answered with a warning",
    "logStatusDiscard": "Calls that were discarded",
    "logStatusError": "Calls that were refused, and why",
    "logStatusFatal": "Failures after which the instance cannot be used",
    "logAll": "All of these",
}
DEFAULT_EXPERIMENT = {"startTime": "0", "stopTime": "15", "tolerance": "1e-06", "stepSize": "0.001"}


def fmi2(model: Model, kind: str = "native", source_files: tuple[str, ...] = ()) -> str:
    """FMI 2.0 model description. `kind` is "native" (model exchange and co-simulation, all capabilities) or
    "python" (co-simulation by pythonfmu, without derivatives of inputs and outputs)."""
    identity = {"fmiVersion": "2.0"} | _identity(model) | {"guid": guid(model, kind), "numberOfEventIndicators": "0"}
    root = ET.Element("fmiModelDescription", identity)
    common = {
        "modelIdentifier": model.name,
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": _true(kind == "native"),
    }
    interfaces = []
    if kind == "native" and not (model.discretes or model.delays):
        interfaces.append(ET.SubElement(root, "ModelExchange", common))
    interfaces.append(
        ET.SubElement(
            root,
            "CoSimulation",
            common
            | {
                "canHandleVariableCommunicationStepSize": "true",
                "canInterpolateInputs": _true(kind == "native"),
                "maxOutputDerivativeOrder": "1" if kind == "native" else "0",
                "canRunAsynchronuously": "false",
            },
        )
    )
    for interface in interfaces:
        if source_files:
            files = ET.SubElement(interface, "SourceFiles")
            for name in source_files:
                ET.SubElement(files, "File", name=name)
    table = _common(
        root,
        model,
        lambda parent, name, attributes: ET.SubElement(
            ET.SubElement(parent, "SimpleType", name=name), "Real", attributes
        ),
    )
    _variables2(root, table)
    _structure2(root, table)
    return _text(root)


def fmi3(model: Model) -> str:
    """FMI 3.0 model description: model exchange and co-simulation."""
    identity = {"fmiVersion": "3.0"} | _identity(model) | {"instantiationToken": guid(model)}
    root = ET.Element("fmiModelDescription", identity)
    common = {
        "modelIdentifier": model.name,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    }
    if not (model.discretes or model.delays):  # they live at communication points, which model exchange does not have
        ET.SubElement(root, "ModelExchange", common | {"needsCompletedIntegratorStep": "true"})
    ET.SubElement(
        root,
        "CoSimulation",
        common
        | {
            "canHandleVariableCommunicationStepSize": "true",
            "maxOutputDerivativeOrder": "1",
            "providesIntermediateUpdate": "true",
            "mightReturnEarlyFromDoStep": "true",
            "canReturnEarlyAfterIntermediateUpdate": "true",
            "hasEventMode": "false",
        },
    )
    table = _common(
        root, model, lambda parent, name, attributes: ET.SubElement(parent, "Float64Type", {"name": name} | attributes)
    )
    _variables3(root, table)
    _structure3(root, table)
    return _text(root)


def build_description(model: Model, source_files: tuple[str, ...]) -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.name)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in source_files:
        ET.SubElement(files, "SourceFile", name=name)
    ET.SubElement(configuration, "Library", name="m", external="true", description="The C mathematics library")
    return _text(root)


def terminals(model: Model) -> str:
    """terminalsAndIcons.xml of FMI 3.0."""
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = ET.SubElement(root, "GraphicalRepresentation")
    square = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    ET.SubElement(graphics, "CoordinateSystem", square | {"suggestedScalingFactorTo_mm": "0.1"})
    ET.SubElement(graphics, "Icon", square)  # the picture is icon.png beside it
    there = {*(q.name for q in model.inputs), *model.outputs}
    ports = [t for t in model.terminals if all(name in there for _, name in t.members)]
    group = ET.SubElement(root, "Terminals") if ports else root  # an empty group is not valid
    for t in ports:
        terminal = ET.SubElement(group, "Terminal", name=t.name, matchingRule="plug", description=t.description)
        for member, variable in t.members:
            ET.SubElement(
                terminal, "TerminalMemberVariable", variableName=variable, memberName=member, variableKind="signal"
            )
    return _text(root)


# What both versions share ----------------------------------------------------------------------------------


def _common(
    root: ET.Element, model: Model, typed: Callable[[ET.Element, str, dict[str, str]], ET.Element]
) -> tuple[Variable, ...]:
    """Units, types (each made by `typed`), log categories and the default experiment; the table of the variables."""
    table = variables(model)
    _units(root, table)
    _types(root, table, typed)
    _log_categories(root)
    ET.SubElement(root, "DefaultExperiment", DEFAULT_EXPERIMENT)
    return table


def _identity(model: Model) -> dict[str, str]:
    added = f"; effects added: {', '.join(model.effects)}" if model.effects else ""
    return {
        "modelName": model.title,
        "description": model.description + added,
        "version": __version__,
        "author": "tubular-dea contributors",
        "license": "MIT",
        "generationTool": f"tubular-dea {__version__}",
        "variableNamingConvention": "structured",
    }


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _true(value: bool) -> str:
    return "true" if value else "false"


def _number(value: float) -> str:
    return repr(float(value))


def _units(root: ET.Element, table: tuple[Variable, ...]) -> None:
    """Every unit in use with its SI exponents, and the display units of its variables."""
    display: dict[str, set[str]] = {}
    for variable in table:
        q = variable.quantity
        display.setdefault(q.unit, set()).update([q.display_unit] if q.display_unit else [])
    group = ET.SubElement(root, "UnitDefinitions")
    for name in sorted(display):
        parsed = units.parse(name)
        unit = ET.SubElement(group, "Unit", name=name)
        exponents = {base: str(e) for base, e in zip(units.BASE, parsed.exponents, strict=True) if e}
        if parsed.factor != 1.0:
            exponents["factor"] = _number(parsed.factor)
        if parsed.whole:
            ET.SubElement(unit, "BaseUnit", exponents)
        for shown in sorted(display[name]):
            ET.SubElement(unit, "DisplayUnit", name=shown, factor=f"{1 / units.factor(shown, name):.15g}")


def _type_name(q: Quantity) -> str | None:
    """One type for each quantity as it is shown: Pressure_mmHg, Length_mm, Length."""
    kind = units.QUANTITY_NAMES.get(q.unit)
    if kind is None:
        return None
    return kind if q.display_unit is None else f"{kind}_{q.display_unit.replace('/', '_per_').replace('.', '_')}"


def _types(
    root: ET.Element, table: tuple[Variable, ...], add: Callable[[ET.Element, str, dict[str, str]], ET.Element]
) -> None:
    named = {_type_name(v.quantity): v.quantity for v in table if v.quantity.type == "Real"}
    group = ET.SubElement(root, "TypeDefinitions")
    for name in sorted(n for n in named if n):
        q = named[name]
        attributes = {"quantity": units.QUANTITY_NAMES[q.unit], "unit": q.unit}
        if q.display_unit:
            attributes["displayUnit"] = q.display_unit
        add(group, name, attributes)


def _log_categories(root: ET.Element) -> None:
    group = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(group, "Category", name=name, description=description)


def _real_attributes(variable: Variable) -> dict[str, str]:
    """Type, unit, bounds and nominal value of a real variable."""
    q = variable.quantity
    attributes = {}
    if _type_name(q):
        attributes["declaredType"] = str(_type_name(q))
    attributes["unit"] = q.unit
    if q.display_unit:
        attributes["displayUnit"] = q.display_unit
    if variable.kind in ("INPUT", "OUTPUT", "STATE", "FOLD", "SAMPLED"):
        attributes["nominal"] = _number(q.nominal)
    return attributes | _bounds(q, _number)


def _bounds(q: Quantity, number: Callable[[float], str]) -> dict[str, str]:
    bounds = {"min": q.minimum, "max": q.maximum}
    return {name: number(value) for name, value in bounds.items() if value is not None}


def _start(variable: Variable) -> str | None:
    """The start value of inputs and parameters as XML text; None for what the model calculates."""
    if variable.kind not in ("INPUT", "PARAMETER"):
        return None
    value = float(variable.quantity.value or 0.0)
    if variable.quantity.type == "Boolean":
        return _true(value != 0)
    return str(int(value)) if variable.quantity.type == "Integer" else _number(value)


def _initial(variable: Variable) -> dict[str, str]:
    """`initial` of what the model calculates; inputs must not have one, parameters are exact by default."""
    return {"initial": "calculated"} if variable.kind in ("OUTPUT", "STATE", "DERIVATIVE", "FOLD", "SAMPLED") else {}


@dataclass(frozen=True)
class _Unknown:
    """An unknown of the model structure: its place in the table from 1, and its attributes of dependence."""

    place: str
    dependencies: dict[str, str]


def _unknowns(table: tuple[Variable, ...]) -> dict[str, list[_Unknown]]:
    """Outputs, state derivatives and initial unknowns with what they depend on: inputs, states and parameters.

    The time is omitted: OMSimulator refuses it among the dependencies.
    """
    place = {v.name: str(i) for i, v in enumerate(table, start=1)}

    def unknown(variable: Variable, names: tuple[str, ...]) -> _Unknown:
        said = [place[name] for name in names if name != "time"]
        kinds = ["dependent"] * len(said)
        return _Unknown(place[variable.name], {"dependencies": " ".join(said), "dependenciesKind": " ".join(kinds)})

    outputs = [v for v in table if v.causality == "output"]
    derivatives = [v for v in table if v.kind == "DERIVATIVE"]
    initial = [v for v in table if v.causality == "output" or v.kind in ("STATE", "DERIVATIVE")]
    return {
        "Outputs": [unknown(v, v.dependencies) for v in outputs],
        "Derivatives": [unknown(v, v.dependencies) for v in derivatives],
        "InitialUnknowns": [unknown(v, v.initial_dependencies) for v in initial],
    }


def _state_of(variable: Variable, table: tuple[Variable, ...]) -> int:
    """The place in the table, from 1, of the state that a derivative belongs to."""
    return next(i for i, v in enumerate(table, start=1) if v.kind == "STATE" and v.index == variable.index)


# FMI 2 -----------------------------------------------------------------------------------------------------


def _variables2(root: ET.Element, table: tuple[Variable, ...]) -> None:
    group = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(table, start=1):
        scalar = ET.SubElement(
            group,
            "ScalarVariable",
            {
                "name": variable.name,
                "valueReference": str(reference),
                "description": _description(variable),
                "causality": variable.causality,
                "variability": variable.variability,
            }
            | _initial(variable),
        )
        attributes = _real_attributes(variable) if variable.quantity.type == "Real" else {}
        if variable.quantity.type == "Integer":
            attributes = _bounds(variable.quantity, lambda value: str(int(value)))
        start = _start(variable)
        if start is not None:
            attributes["start"] = start
        if variable.kind == "DERIVATIVE":
            attributes["derivative"] = str(_state_of(variable, table))
        ET.SubElement(scalar, variable.quantity.type, attributes)


def _structure2(root: ET.Element, table: tuple[Variable, ...]) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    for section, unknowns in _unknowns(table).items():
        if unknowns:
            group = ET.SubElement(structure, section)
            for variable in unknowns:
                ET.SubElement(group, "Unknown", {"index": variable.place} | variable.dependencies)


def _description(variable: Variable) -> str:
    q = variable.quantity
    text = f"{q.description} ({q.source})" if q.source and variable.kind != "DERIVATIVE" else q.description
    if not variable.rates:
        return text
    return f"{text}; in model exchange, where hosts give no rate of {' and '.join(variable.rates)}, as if it were held"


# FMI 3 -----------------------------------------------------------------------------------------------------


def _variables3(root: ET.Element, table: tuple[Variable, ...]) -> None:
    group = ET.SubElement(root, "ModelVariables")
    element = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}
    for reference, variable in enumerate(table, start=1):
        attributes = {
            "name": variable.name,
            "valueReference": str(reference),
            "description": _description(variable),
            "causality": variable.causality,
            "variability": variable.variability,
        } | _initial(variable)
        if variable.kind not in ("TIME", "PARAMETER"):
            attributes["intermediateUpdate"] = "true"
        if variable.quantity.type == "Real":
            attributes |= _real_attributes(variable)
        elif variable.quantity.type == "Integer":
            attributes |= _bounds(variable.quantity, lambda value: str(int(value)))
        start = _start(variable)
        if start is not None:
            attributes["start"] = start
        if variable.kind == "DERIVATIVE":
            attributes["derivative"] = str(_state_of(variable, table))
        ET.SubElement(group, element[variable.quantity.type], attributes)


def _structure3(root: ET.Element, table: tuple[Variable, ...]) -> None:
    element = {"Outputs": "Output", "Derivatives": "ContinuousStateDerivative", "InitialUnknowns": "InitialUnknown"}
    structure = ET.SubElement(root, "ModelStructure")
    for section, unknowns in _unknowns(table).items():
        for variable in unknowns:
            ET.SubElement(structure, element[section], {"valueReference": variable.place} | variable.dependencies)
