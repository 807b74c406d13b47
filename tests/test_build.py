"""A model declared by hand with an equilibrium curve; what is wrong with a start or a value at rest, at its line."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from tubular_dea.kernel import Kernel
from tubular_dea.plants import Build, DeclarationError, EquilibriumCurve, Quantity


def balloon(start: object = 0.1, rest: object = None, curve: bool = True) -> Build:
    """A store whose load rises and falls again with what is in it: load = a x - b x^3 at rest, its fold at x = 1."""
    m = Build("Balloon")
    load = m.input("load", "N", nominal=1.0)
    a, b = m.parameter("a", "N/m", 3.0), m.parameter("b", "N/m3", 1.0)
    damping = m.parameter("damping", "N.s/m", 1.0)
    x = m.state("x", "m", start=start, equilibrium=rest, nominal=1.0)
    held = m.define("held", "N", a * x - b * x**3)
    m.derivative(x, (load - held) / damping)
    m.output("reading", "m", x)
    if curve:
        fold = Quantity("fold_load", "N", "Load at the fold", nominal=2.0)
        m.equilibrium_curve(EquilibriumCurve("held", "load", "x", fold, 0.0, 0.0, 3.0, "start_at_rest"))
    return m


def test_a_declared_curve_has_its_fold_and_switch() -> None:
    x = sympy.Symbol("x", real=True)
    kernel = Kernel(balloon(rest=x).model())
    load, slope, fold = kernel.curve(np.array([0.0, 0.5]), {})
    np.testing.assert_allclose(load, [0.0, 1.375], atol=1e-12)
    np.testing.assert_allclose(slope, [3.0, 2.25], atol=1e-9)
    np.testing.assert_allclose(fold, [1.0, 2.0], rtol=1e-6)
    assert kernel.defaults["start_at_rest"] == 0.0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"start": sympy.Symbol("nowhere")}, "the start of x uses nowhere, which is not declared before it"),
        ({"rest": "a"}, "state 'x': equilibrium: expected an expression but was given 'a'"),
        ({"rest": sympy.Symbol("load", real=True)}, "the equilibrium of x"),
    ],
)
def test_a_wrong_start_or_value_at_rest_is_told_at_its_line(given: dict[str, object], said: str) -> None:
    with pytest.raises(DeclarationError) as refusal:
        balloon(**given).model()
    assert said in str(refusal.value)
    assert str(refusal.value).startswith("test_build.py, line ")
