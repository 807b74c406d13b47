"""The declaration itself, the facts of the paper, and the emitted code against a hand-written right-hand side."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from sympy import Float

import independent
from scenarios import MMHG, POINTS
from tubular_dea.emit import c
from tubular_dea.emit.variables import guid, variables
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.model.build import Build
from tubular_dea.model.dea import printed_sine, tubular_dea
from tubular_dea.model.declare import DeclarationError, Definition, Model, Quantity
from tubular_dea.protocol import Protocol

P_95 = 95 * MMHG


# Facts computed independently (design.md section 1) -----------------------------------------------------------


@pytest.mark.parametrize(
    ("kilovolt", "millimetre"), [(0, 17.82), (4, 18.40), (5, 18.80), (5.5, 19.07), (6, 19.41), (7, 20.52)]
)
def test_equilibrium_radius_at_95_mmhg(kernel: Kernel, kilovolt: float, millimetre: float) -> None:
    hold = Protocol.of([0, 1], pressure=[P_95] * 2, voltage=[1e3 * kilovolt] * 2)
    rest = kernel.simulate(hold, np.array([0.0, 1.0]), {"start_at_equilibrium": 1})
    assert rest["radius"][0] == pytest.approx(1e-3 * millimetre, abs=0.6e-5)
    assert rest["radius"][1] == pytest.approx(rest["radius"][0], abs=1e-12), "a rest state stays"
    assert rest["radius"][0] == pytest.approx(independent.equilibrium_radius(P_95, 1e3 * kilovolt), abs=1e-12)


@pytest.mark.parametrize(
    ("kilovolt", "millimetre", "mmhg"),
    [(0, 25.6, 170), (4, 24.5, 147), (5, 24.0, 135), (5.5, 23.8, 128), (6, 23.5, 121), (7, 23.0, 104.6)],
)
def test_snap_through_fold(kernel: Kernel, kilovolt: float, millimetre: float, mmhg: float) -> None:
    _, _, (lambda_2, pressure) = kernel.curve(np.array([1.0]), {"voltage": 1e3 * kilovolt})
    assert 15 * lambda_2 == pytest.approx(millimetre, abs=0.051)
    assert pressure / MMHG == pytest.approx(mmhg, abs=0.6)
    radius, load = independent.fold(1e3 * kilovolt)
    assert (15e-3 * lambda_2, pressure) == (pytest.approx(radius, abs=1e-8), pytest.approx(load, rel=1e-12))


def test_stiffness_at_95_mmhg_and_4_kv(kernel: Kernel) -> None:
    rest = [independent.equilibrium_radius(P_95, 4000.0) / 15e-3, 0, 0, 0]
    corrected = np.sort(np.linalg.eigvals(kernel.jacobian(rest, [P_95, 4000.0])).real)
    np.testing.assert_allclose(corrected, np.sort(independent.eigenvalues(P_95, 4000.0).real), rtol=1e-9)
    np.testing.assert_allclose(corrected, [-23080, -162.8, -2.527, -0.3617], rtol=1e-3)
    assert corrected[0] / corrected[-1] == pytest.approx(6.4e4, rel=0.01)


def test_printed_equation_4_gives_the_printed_eigenvalues() -> None:
    """design.md lists the eigenvalues of the printed form: -22 489 and -165."""
    printed = Kernel(printed_sine(tubular_dea()))
    hold = Protocol.of([0, 1], pressure=[P_95] * 2, voltage=[4000.0] * 2)
    rest = printed.simulate(hold, np.array([0.0]), {"start_at_equilibrium": 1})
    values = np.sort(np.linalg.eigvals(printed.jacobian([rest["lambda_2"][0], 0, 0, 0], [P_95, 4000.0])).real)
    np.testing.assert_allclose(values, [-22489, -165, -2.5, -0.36], rtol=0.02)
    assert values[0] == pytest.approx(-22489, abs=1)
    corrected = independent.equilibrium_radius(P_95, 4000.0)
    assert 1e-6 < abs(rest["radius"][0] - corrected) < 0.03e-3, "the erratum moves the tube by at most 0.03 mm"


def test_ringing_at_rest(kernel: Kernel) -> None:
    """At lambda_2 = 1 nothing damps: a ring at 387 Hz."""
    values = np.linalg.eigvals(kernel.jacobian([1, 0, 0, 0], [0, 0])).imag
    assert values.max() / (2 * np.pi) == pytest.approx(387, abs=0.5)


def test_mass_and_capacitance_at_rest(kernel: Kernel, model: Model) -> None:
    values = {q.symbol: q.value for q in (p.quantity for p in model.parameters)}
    assert float(model.expression("m").subs(values)) == pytest.approx(4.618e-3, abs=1e-6)
    still = kernel.simulate(Protocol.of([0, 1], pressure=[0, 0], voltage=[0, 0]), np.array([0.0]))
    assert still["capacitance"][0] == pytest.approx(9.2e-9, abs=0.05e-9)
    assert still["tube_volume"][0] == pytest.approx(2 * np.pi * 15e-3**2 * 24.5e-3, rel=1e-12)


# The emitted code ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("x", "u"), POINTS)
def test_right_hand_side_is_the_hand_written_one(kernel: Kernel, x: tuple, u: tuple) -> None:
    mine = kernel.derivatives(x, u)
    theirs = independent.rhs(0.0, np.array(x), *u, independent.PARAMETERS)
    np.testing.assert_allclose(mine, theirs, rtol=1e-11, atol=1e-9)


@pytest.mark.parametrize(("x", "u"), POINTS)
def test_jacobian_is_exact(kernel: Kernel, x: tuple, u: tuple) -> None:
    mine = kernel.jacobian(x, u)
    theirs = independent.jacobian(np.array(x), *u, independent.PARAMETERS)
    scale = np.abs(theirs).max(axis=1, keepdims=True) + 1e-12
    np.testing.assert_allclose(mine / scale, theirs / scale, atol=1e-10)


def test_named_intermediates_survive_in_c(model: Model) -> None:
    text = c.source(model)
    for name in ("lambda_1", "sigma_hoop", "F_dea", "A_3", "dW_dI_1", "lambda_2_acceleration"):
        assert f"double {name} = " in text
    assert "pow(" not in text, "integer powers are products"


def test_dependencies_are_structural_truth(model: Model) -> None:
    table = {v.name: v for v in variables(model)}
    assert table["radial_displacement"].dependencies == ("lambda_2",)
    assert table["electric_field"].dependencies == ("voltage", "lambda_2")
    assert table["tube_flow"].dependencies == ("lambda_2", "lambda_2_rate")
    assert table["snap_through_margin"].dependencies == ("pressure", "voltage")


def test_guid_is_a_hash_of_the_model(model: Model) -> None:
    assert guid(model) == guid(tubular_dea())
    changed = [printed_sine(model), model.with_values({"C_1": 3e5}), guid(model, "python")]
    assert len({guid(model), *(m if isinstance(m, str) else guid(m) for m in changed)}) == 4


# Changing a declaration ---------------------------------------------------------------------------------------------


def test_nothing_is_changed_silently(model: Model) -> None:
    with pytest.raises(DeclarationError, match="no definition 'sigma_hop'; did you mean sigma_hoop"):
        model.replace("sigma_hop", Float(1))
    with pytest.raises(DeclarationError, match="no state 'lambda_3'"):
        model.drive("lambda_3", Float(1))
    with pytest.raises(DeclarationError, match="declares 'radius' twice"):
        model.observe(Quantity("radius", "m", "again"), Float(1))
    with pytest.raises(DeclarationError, match="uses nonsense before it is declared"):
        model.replace("sigma_hoop", sympy.Symbol("nonsense", real=True))
    with pytest.raises(DeclarationError, match="no parameter 'C_4'; did you mean"):
        model.with_values({"C_4": 1.0})
    late = Definition(Quantity("late", "1", "uses what comes after it"), model["radius"] * 2)
    with pytest.raises(DeclarationError, match="uses radius before it is declared"):
        model.extend(definitions=[late], before="lambda_1")


def test_a_definition_can_be_replaced_and_observed(model: Model) -> None:
    stiff = model.replace("dW_dI_1", 2 * model.expression("dW_dI_1")).observe(
        Quantity("diameter", "m", "Outer size"), 2 * model["radius"]
    )
    kernel = Kernel(stiff)
    hold = Protocol.of([0, 1], pressure=[P_95] * 2, voltage=[0, 0])
    rest = kernel.simulate(hold, np.array([0.0]), {"start_at_equilibrium": 1})
    assert rest["diameter"][0] == pytest.approx(2 * rest["radius"][0])
    assert rest["radius"][0] < 17e-3


# The kernel -----------------------------------------------------------------------------------------------------------


def test_tunable_parameters_are_as_declared(model: Model) -> None:
    tunable = [p.quantity.name for p in model.parameters if p.tunable]
    assert tunable == ["C_1", "C_2", "C_3", "eps_r", "eta_o", "k_1", "eta_1", "k_2", "eta_2"]


def test_any_protocol_against_the_independent_integration(kernel: Kernel) -> None:
    """A beat with other parameters: pressure triangles and a square of voltage, off Table III by 5 %."""
    inputs = {
        "time": [0, 0.2, 0.2, 0.4, 0.4, 0.8, 1.0],
        "pressure": [9e3, 14e3, 14e3, 16e3, 16e3, 9e3, 9e3],
        "voltage": [0, 0, 5e3, 5e3, 0, 0, 0],
    }
    values = {"C_1": 1.05 * 333.056e3, "eta_o": 0.95 * 745.854e3, "eps_r": 2.9}
    times = np.linspace(0, 1, 101)
    mine = kernel.simulate(Protocol.of(**inputs), times, values)
    theirs = independent.trajectory(inputs, times, {**independent.PARAMETERS, **values})
    for name, tolerance in {"lambda_2": 1e-6, "tube_volume": 1e-10, "capacitance": 1e-13, "radius": 2e-8}.items():
        np.testing.assert_allclose(mine[name], theirs[name], atol=tolerance, err_msg=name)


def test_no_rest_state_beyond_the_fold(kernel: Kernel) -> None:
    hold = Protocol.of([0, 1], pressure=[300 * MMHG] * 2, voltage=[7e3] * 2)
    with pytest.raises(KernelError, match="no rest state to start at"):
        kernel.simulate(hold, np.array([0.0]), {"start_at_equilibrium": 1})


def test_kernel_refuses_what_it_cannot_mean(kernel: Kernel) -> None:
    hold = Protocol.of([0, 1], pressure=[0, 0], voltage=[0, 0])
    with pytest.raises(KernelError, match="no parameter 'C1'; did you mean C_1"):
        kernel.simulate(hold, np.array([0.0]), {"C1": 1.0})
    with pytest.raises(KernelError, match="expected ascending times from 0 to 1 s"):
        kernel.simulate(hold, np.array([0.0, 2.0]))
    with pytest.raises(KeyError, match="did you mean radius"):
        kernel.simulate(hold, np.array([0.0]))["radus"]


def test_a_difference_that_cancels_where_all_is_usual_is_as_large_as_with_half_of_one_value() -> None:
    """A judge's filling = (p_set - p) / tau was of 1 Pa/s: a hysteresis was named in place of a dead band."""
    m = Build("Chamber", "A chamber that fills")
    p_set = m.input("p_set", "Pa", nominal=1e5)
    tau = m.parameter("tau", "s", 0.1, minimum=1e-3)
    p = m.state("p", "Pa", nominal=1e5)
    over = m.define("over", "Pa", p_set - p)
    filling = m.define("filling", "Pa/s", over / tau)
    m.derivative(p, filling)
    m.output("chamber", "Pa", p)
    model = m.model()
    assert (model.quantity("over").nominal, model.quantity("filling").nominal) == pytest.approx((5e4, 5e5))


def test_a_difference_of_which_an_offset_is_left_is_as_large_as_with_half_of_one_signal() -> None:
    """A servo's drive was of 12 rad/s2, what its trim makes: no saturation was sought near the 150 it has."""
    m = Build("Servo", "A servo")
    command = m.input("command", "rad", nominal=1.9)
    trim, stiffness = m.parameter("trim", "rad", 0.03), m.parameter("stiffness", "1/s2", 400.0)
    damping, usual = m.parameter("damping", "1/s", 30.0), m.parameter("usual", "rad", 1.9, tunable=False)
    power = m.parameter("power", "1", -8.0)
    q = m.state("q", "rad", nominal=1.9)
    w = m.state("w", "rad/s", nominal=5.0)
    drive = m.define("drive", "rad/s2", stiffness * (command + trim - q))
    steep = m.define("steep", "1", (q / usual) ** power)  # no difference, though half an angle makes it 256 times that
    m.derivative(q, w)
    m.derivative(w, drive * steep - damping * w)
    m.output("angle", "rad", q)
    model = m.model()
    assert (model.quantity("drive").nominal, model.quantity("steep").nominal) == pytest.approx((400 * 0.98, 1.0))


def test_a_parameter_declared_as_nothing_is_as_large_as_it_takes_to_matter() -> None:
    m = Build("Tank")
    pump, level = m.input("pump", "V", nominal=5.0), m.state("level", "m", nominal=0.2)
    leak, bump = m.parameter("leak", "1/s", 0.0), m.parameter("bump", "1/m2", 0.0)
    m.parameter("idle", "1", 0.0)
    told = m.parameter("told", "m", 0.0, nominal=3e-3)
    m.derivative(level, m.parameter("gain", "m/V/s", 0.02) * pump - leak * level * (1 + bump * level**2))
    m.output("reading", "mm", 1e3 * (level + told), nominal=200.0)
    sizes = {p.quantity.name: p.quantity.nominal for p in m.model().parameters}
    assert sizes["leak"] == pytest.approx(0.02 * 5 / 0.2)  # drains as much as the pump brings
    assert sizes["told"] == 3e-3 and sizes["idle"] == 1.0 and sizes["gain"] == 0.02
    assert sizes["bump"] == 1.0  # nothing leaks
