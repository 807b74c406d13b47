"""Units of a plant file: wrong ones are refused where they are declared, odd but right ones pass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy

from tubular_dea.model.declare import DeclarationError, Model, rate
from tubular_dea.model.dimensions import fault, per_second
from tubular_dea.model.units import UnitError, combined, parse
from tubular_dea.plants import Build, magnitude, positive_part, root, step
from tubular_dea.plants.load import PlantError, load_plant

EXAMPLES = Path(__file__).parents[1] / "cosim_examples/plants"
CARRIAGE = """from tubular_dea.plants import *
m = Build("Carriage", "A mass on a spring")
force = m.input("force", "N", "Force of the shaker", nominal=120)
c = m.parameter("c", "N.s/m", 15.0, "Damping", minimum=0)
k = m.parameter("k", "N/m", 4e4, "Stiffness", minimum=1.0)
mass = m.parameter("mass", "kg", 2.0, "Mass", tunable=False)
x = m.state("x", "m", "Position", start="free", nominal=2e-3)
v = m.state("v", "m/s", "Velocity", start="free", nominal=0.3)
spring = m.define("spring", "N", k * x, "Force of the spring")
m.derivative(x, v)
m.derivative(v, (force - c * v - spring) / mass)
m.output("displacement", "m", x, "Displacement sensor", display_unit="mm")
PLANT = Plant(m.model(), [Input("force")], [Output("displacement")])
"""
BARE = {"amplifier_slew", "field_dependent_permittivity", "mullins_softening", "thermal_softening"}
"""Effects of the tube whose constants (5 ms, 1e8 V/m) stand as bare numbers in their equations."""


@pytest.mark.parametrize(
    ("right", "wrong", "line", "words"),
    [
        ("k * x,", "k * v,", 9, "spring: expected N but k*v is in N/s; correct the expression or the unit"),
        ("(x, v)", "(x, force)", 10, "the derivative of x: expected m/s but force is in N; correct"),
        ('"m", x,', '"m", v,', 12, "displacement: expected m but v is in m/s; correct"),
        ("c * v -", "c * x -", 11, "force is in N and c*x in N.s: they cannot be added or compared"),
        ("- spring)", "- spring - 9.81 * mass)", 11, "(the number 9.81 has no unit: if it needs one, m.parameter("),
        ('"x", "m"', '"x", "mm"', 9, "spring: expected N but k*x is in N.mm/m; multiply it by 0.001, or correct"),
        ('start="free", nominal=0.3', "start=x", 8, "the start of v: expected m/s but x is in m"),
        (
            "k * x,",
            "k * x * exp(x),".replace("exp", "__import__('sympy').exp"),
            9,
            "what a function like exp is of has to be a number",
        ),
    ],
)
def test_a_wrong_unit_is_refused_in_its_line(right: str, wrong: str, line: int, words: str, tmp_path: Path) -> None:
    text = CARRIAGE.replace(right, wrong)
    assert text != CARRIAGE
    file = tmp_path / "carriage.py"
    file.write_text(text)
    with pytest.raises(PlantError) as problem:
        load_plant(str(file))
    said = str(problem.value)
    assert said.startswith(f"{file}, line {line}: ") and words in said and "\n" not in said


U = {"x": "m", "y": "mm", "v": "m/s", "n": "1", "p": "Pa", "a": "deg", "b": "rad", "w": "rpm", "h": "%", "T": "degC"}
U |= {"R": "degC", "K": "K"}
S = {name: sympy.Symbol(name, real=True) for name in U}
x, y, v, n, p, a, b, w, h, T, R, K = S.values()
KNOWN = {S[name]: unit for name, unit in U.items()}


@pytest.mark.parametrize(
    ("expression", "unit"),
    [
        (x + 1e-3 * y, "m"),  # a factor that converts
        (2 * sympy.pi * w, "rad/s"),
        (root(x, 1e-3), "m0.5"),
        (sympy.sqrt(x**2 + 1e-9), "m"),
        (x * magnitude(v), "m2/s"),
        (x * sympy.tanh(v / 1e-3 / S["v"]) * sympy.sign(p) * step(v), "m"),
        (positive_part(x - 0.1), "m"),
        (sympy.Max(x, 0) + sympy.Abs(x) + sympy.Min(x, 2.0), "m"),
        (sympy.Piecewise((x, v > 0), (0, sympy.And(p < 3, n > 0)), (-x, True)), "m"),
        (p * n**n, "Pa"),
        (p * x**n, "N"),  # a power that changes: any unit
        (x**1.852, "m1.852"),
        (sympy.cbrt(x), "m0.33"),
        (sympy.sin(b) + sympy.exp(-n) + sympy.log(x / (2 * x + 0.1)), "1"),
        (n - 1, "rad"),
        (sympy.sin(a * 3.14159 / 180), "1"),
        (T + 273.15, "K"),
        (K - 273.15, "degC"),
        (T - R, "K"),
        (sympy.Max(T + K, R), "degC"),
        (sympy.Float(9.81), "m/s2"),
        (sympy.Integer(0), "N"),
        (sympy.atan2(x, 2 * x), "rad"),
        (p * x**2, "N"),
        (0.01 * h * x, "m"),
        (sympy.Symbol("elsewhere") * x, "N"),
    ],
)
def test_what_is_right_or_cannot_be_known_passes(expression: sympy.Expr, unit: str) -> None:
    assert fault("q", expression, unit, KNOWN) == ""


@pytest.mark.parametrize(
    ("expression", "unit", "words"),
    [
        (x + v, "m", "v is in m/s and x in m: they cannot be added"),
        (x + y, "m", "they cannot be added or compared; 1 mm is 0.001 m: declare both in one unit, as in SI"),
        (sympy.sqrt(x), "m", "is in m0.5"),
        (x * v**2, "m", "is in m3/s2"),
        (sympy.Max(x, v), "m", "they cannot be added or compared"),
        (sympy.Piecewise((x, v > p), (0, True)), "m", "they cannot be added or compared"),
        (sympy.Piecewise((x, v > 0), (v, True)), "m", "they cannot be added or compared"),
        (sympy.log(p), "1", "what a function like exp is of has to be a number (angles in rad), but p is in Pa"),
        (sympy.sin(a), "1", "a is in deg"),
        (sympy.sin(x * n) * x, "m", "n*x is in m"),
        (n**x, "1", "the exponent of n has to be a number"),
        (x * step(x + v), "m", "cannot be added"),
        (y, "m", "multiply it by 0.001, or correct the unit"),
        (w, "rad/s", "expected rad/s but w is in rpm; multiply it by 0.10472"),
        (2 * x, "kg", "(the number 2 has no unit"),
        (K, "degC", "K is in K: the zero of degC is at 273.15 K; declare it in K"),
        (T, "K", "T is in degC: the zero of degC is at 273.15 K"),
        (T - R, "degC", "is in degC, as a difference: the zero of degC is at 273.15 K"),
    ],
)
def test_what_is_wrong_is_said(expression: sympy.Expr, unit: str, words: str) -> None:
    said = fault("q", expression, unit, KNOWN)
    assert said.startswith("q: ") and words in said


def faults(model: Model) -> list[str]:
    """What the check says of a finished model."""
    known = {sympy.Symbol("time", real=True): "s", **{q.symbol: q.unit for q in model.quantities().values()}}
    moving = (*model.inputs, *(d.quantity for d in model.delays))
    known |= {rate(q): per_second(q.unit) for q in moving}
    found = [fault(d.quantity.name, sympy.sympify(d.expression), d.quantity.unit, known) for d in model.definitions]
    for s in model.states:
        found.append(fault(s.quantity.name, sympy.sympify(s.derivative), per_second(s.quantity.unit), known))
        found.append(fault(s.quantity.name, sympy.sympify(s.start), s.quantity.unit, known))
    return [said for said in found if said]


@pytest.mark.parametrize(
    "name",
    ["tube", "aorta", *(str(f) for f in sorted(EXAMPLES.glob("*.py"))), f"{EXAMPLES}/cascaded_tanks.py:SQUARE_ROOT"],
)
def test_all_that_is_shipped_passes(name: str) -> None:
    plant = load_plant(name)
    assert faults(plant.model) == []
    for effect in plant.catalogue.values():
        if effect.id not in BARE:
            assert faults(effect(plant.model)) == [], effect.id


def test_a_unit_may_have_a_broken_exponent() -> None:
    for text in ("m3/(s.Pa^0.5)", "m3/s/Pa0.5"):
        assert combined((text, 1), ("Pa0.5", 1)) == "m3/s"
        assert parse(text).exponents == parse("m3.5/kg0.5").exponents
    assert parse("V^0.5.s").exponents == parse("s.V0.5").exponents and parse("mm0.5").factor == pytest.approx(1e-3**0.5)
    with pytest.raises(UnitError, match=r"cannot read the unit 'm0.5.5'"):
        parse("m0.5.5")
    m = Build("Valve")
    drop = m.input("drop", "Pa", nominal=1e5)
    m.output("flow", "m3/s", m.parameter("K", "m3/s/Pa0.5", 1e-6) * root(drop, 10.0))
    assert np.isclose(m.model().quantity("flow").nominal, 1e-6 * 1e5**0.5)
    with pytest.raises(DeclarationError, match=r"test_dimensions.py, line \d+: other: expected m/s but K is in"):
        m.output("other", "m/s", sympy.Symbol("K", real=True))
