"""What the kernel is handed: each thing it cannot use has its own words, and what it can use gives the right answer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tubular_dea.errors import UserError
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.model.dea import tubular_dea
from tubular_dea.protocol import Protocol, ProtocolError

PROTOCOL = Protocol.of([0, 1], pressure=[1e4, 1.2e4], voltage=[0, 4e3])
TIMES = np.linspace(0, 1, 5)
X, U = [1.1, 0.0, 0.0, 0.0], [1e4, 4e3]


def times(*values: float) -> np.ndarray:
    return np.array(values)


def constant(time: list[float], pressure: list[float]) -> Protocol:
    return Protocol(np.array(time), {"pressure": np.array(pressure), "voltage": np.zeros(len(time))})


REFUSED: dict[str, tuple[Callable[[Kernel], object], str]] = {
    "sign": (
        lambda k: k.simulate(PROTOCOL, TIMES, {"C_1": -340e3}),
        "C_1: expected at least 1 Pa but was given -340000",
    ),
    "half": (
        lambda k: k.simulate(PROTOCOL, TIMES, {"n_layers": 7.5}),
        "n_layers: expected an integer but was given 7.5",
    ),
    "maybe": (lambda k: k.parameters({"start_at_equilibrium": 2}), "start_at_equilibrium: expected true or false"),
    "word": (lambda k: k.parameters({"C_1": "large"}), "C_1: expected a number in Pa but was given 'large'"),
    "nan": (lambda k: k.parameters({"k_1": np.nan}), "k_1: expected a finite number in Pa but was given nan"),
    "too large": (lambda k: k.parameters({"phi": 1.5}), "phi: expected at most 1 but was given 1.5"),
    "unknown": (lambda k: k.parameters({"C_7": 1.0}), "no parameter 'C_7'; did you mean C_"),
    "tolerance": (
        lambda k: k.simulate(PROTOCOL, TIMES, tolerance=-1),
        "tolerance: expected a positive number but was given -1",
    ),
    "tolerance nan": (
        lambda k: k.mesh(PROTOCOL, tolerance=np.nan),
        "tolerance: expected a positive number but was given nan",
    ),
    "steps": (
        lambda k: k.simulate(PROTOCOL, TIMES, max_steps=0),
        "max_steps: expected a positive number but was given 0",
    ),
    "times nan": (
        lambda k: k.simulate(PROTOCOL, times(0, np.nan)),
        "sample times: expected ascending times from 0 to 1 s",
    ),
    "times back": (
        lambda k: k.simulate(PROTOCOL, times(0.5, 0.2)),
        "sample times: expected ascending times from 0 to 1 s",
    ),
    "times flat": (lambda k: k.simulate(PROTOCOL, TIMES[None, :]), "sample times: expected ascending times"),
    "mesh": (
        lambda k: k.simulate(PROTOCOL, TIMES, mesh=times(0.5, 2.0)),
        "mesh: expected ascending times from 0 to 1 s",
    ),
    "empty mesh": (  # a whole second in one step: lambda_2 = 1.087 for 1.138
        lambda k: k.simulate(PROTOCOL, TIMES, mesh=times()),
        "mesh: expected steps that end at every point of the protocol up to the last sample",
    ),
    "short mesh": (lambda k: k.simulate(PROTOCOL, TIMES, mesh=times(0.3)), "mesh: expected steps that end at every"),
    "length": (
        lambda k: k.simulate(Protocol(times(0, 1), {"pressure": times(0), "voltage": times(0, 0)}), TIMES),
        "pressure: expected 2 values, one a time, but was given 1",
    ),
    "input nan": (
        lambda k: k.simulate(constant([0, 1], [np.nan, 0]), TIMES),
        "pressure: expected a finite number in Pa",
    ),
    "backwards": (lambda k: k.simulate(constant([1, 0], [0, 0]), TIMES), "two finite times [s] that do not descend"),
    "no length": (
        lambda k: k.simulate(constant([1, 1], [0, 0]), times(1.0)),
        "an end after its start but both are at 1 s",
    ),
    "no names": (
        lambda k: k.simulate(PROTOCOL, TIMES, [1, 2]),
        "parameters: expected values by name, as in a dict, but was given [1, 2]",
    ),
    "false names": (lambda k: k.parameters([]), "parameters: expected values by name, as in a dict"),
    "curve of nothing": (
        lambda k: k.curve([1.1], None),
        "inputs: expected values by name, as in a dict, but was given None",
    ),
    "curve of a list": (lambda k: k.curve([1.1], [1]), "inputs: expected values by name, as in a dict"),
    "curve input": (lambda k: k.curve(times(1.2), {"volts": 1.0}), "no input 'volts'; did you mean voltage"),
    "curve value": (lambda k: k.curve(times(1.2), {"voltage": np.inf}), "voltage: expected a finite number in V"),
    "curve place": (lambda k: k.curve(times(np.nan), {}), "lambda_2: expected a list of finite numbers"),
    "wanted": (
        lambda k: k.simulate(PROTOCOL, TIMES, wanted=["lamda_2"]),
        "wanted: TubularDEA has no value 'lamda_2'; did",
    ),
    "observed": (lambda k: Kernel(k.model, ["nonsense"]), "observed: TubularDEA has no value 'nonsense'"),
    "model": (lambda k: Kernel("tube"), "model: expected a Model, as tube() or load() give it, but was given 'tube'"),
    "protocol": (lambda k: k.simulate({"pressure": 1.0}, TIMES), "protocol: expected a Protocol, as Protocol.of"),
    "no protocol": (lambda k: k.mesh(None), "protocol: expected a Protocol"),
    "times of words": (lambda k: k.simulate(PROTOCOL, ["now"]), "sample times: expected numbers but was given ['now']"),
    "tolerance of words": (
        lambda k: k.simulate(PROTOCOL, TIMES, tolerance="1e-6"),
        "tolerance: expected a positive number but was given '1e-6'",
    ),
    "half a step": (
        lambda k: k.simulate(PROTOCOL, TIMES, max_steps=2.5),
        "max_steps: expected a whole number but was given 2.5",
    ),
    "time of words": (lambda k: k.derivatives(X, U, time="a"), "time: expected numbers but was given ['a']"),
    "no stretch": (lambda k: k.derivatives([0, 0, 0, 0], U), "derivatives: the equations give no finite number"),
    "no stretch of a curve": (lambda k: k.curve(times(0.0), {}), "curve: the equations give no finite number"),
    "short states": (
        lambda k: k.derivatives([1, 0], U),
        "states: expected 4 values (lambda_2, lambda_2_rate, sigma_vis1",
    ),
    "short inputs": (lambda k: k.jacobian(X, [0]), "inputs: expected 2 values (pressure, voltage) but was given 1"),
    "states nan": (lambda k: k.derivatives([1, 0, np.nan, 0], U), "states: expected finite numbers but was given nan"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(kernel: Kernel, case: str) -> None:
    call, words = REFUSED[case]
    with pytest.raises(KernelError) as refusal:
        call(kernel)
    assert words in str(refusal.value)


@pytest.mark.parametrize("argument", ["sensitivities", "wanted"])
def test_one_name_alone_is_no_list_of_names(kernel: Kernel, argument: str) -> None:
    with pytest.raises(UserError, match=rf"^{argument}: expected a list, as \['C_1'\], but was given 'C_1' alone"):
        kernel.simulate(PROTOCOL, TIMES, **{argument: "C_1"})


def test_one_observed_output_is_no_list_of_names() -> None:
    with pytest.raises(UserError, match=r"^observed: expected a list, as \['radius'\]"):
        Kernel(tubular_dea(), "radius")


def test_whole_numbers_and_lists_are_a_protocol_like_doubles(kernel: Kernel) -> None:
    doubles = Protocol(times(0, 1, 1, 2), {"pressure": times(0, 0, 10000, 10000), "voltage": times(0, 0, 0, 4000)})
    whole = {"pressure": np.array([0, 0, 10000, 10000]), "voltage": np.array([0, 0, 0, 4000])}
    lists = {name: values.tolist() for name, values in whole.items()}
    samples = np.linspace(0, 2, 9)
    expected = kernel.simulate(doubles, samples)
    for given in (Protocol(np.array([0, 1, 1, 2]), whole), Protocol([0, 1, 1, 2], lists)):
        found = kernel.simulate(given, samples)
        assert all(np.array_equal(found[name], expected[name]) for name in expected.values)
        assert given.jumps.tolist() == [1.0]


def test_a_missing_input_is_named(kernel: Kernel) -> None:
    with pytest.raises(ProtocolError, match="the protocol lacks voltage; it has pressure"):
        kernel.simulate(Protocol(times(0, 1), {"pressure": times(0, 0)}), TIMES)


@pytest.mark.parametrize("names", [(), ("C_1",)])
def test_no_times_give_no_values(kernel: Kernel, names: tuple[str, ...]) -> None:
    found = kernel.simulate(PROTOCOL, times(), sensitivities=names)
    assert found["lambda_2"].shape == (0,)
    assert all(found.sensitivities[n].shape == (0, 1) for n in found.sensitivities) or not names


@pytest.mark.parametrize("names", [(), ("C_1",)])
@pytest.mark.parametrize("at", [0.5, 1e-3, 300.0])
def test_breakpoints_one_ulp_apart_are_a_jump(kernel: Kernel, names: tuple[str, ...], at: float) -> None:
    end = at + 0.2
    samples = times(0, 0.5 * at, at, at + 0.1, end)
    near = constant([0, at, np.nextafter(at, np.inf), end], [1e4, 1e4, 1.2e4, 1.2e4])
    jump = constant([0, at, at, end], [1e4, 1e4, 1.2e4, 1.2e4])
    found, expected = (kernel.simulate(p, samples, sensitivities=names)["lambda_2"] for p in (near, jump))
    assert np.max(np.abs(found - expected)) < 1e-9
