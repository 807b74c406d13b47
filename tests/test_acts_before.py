"""An input that acts before it is recorded, where it is held: the tangent at no delay does not see it."""

from __future__ import annotations

import numpy as np

import tubular_dea as td
from tubular_dea.plants import Balance, Build, Input, Output, Path, Plant

TAU, STEP, SAMPLES, EARLY, NOISE = 4.0, 1.0, 400, 0.6, 0.02


def vessel() -> Plant:
    """A heated vessel; the record of the heater may come late."""
    m = Build("Vessel", "A heated vessel")
    heater = m.input("heater", "1", nominal=1.0)
    tau, gain = m.parameter("tau", "s", 3.0, minimum=0.1), m.parameter("gain", "K", 10.0)
    rise = m.state("rise", "K", start="free", nominal=10.0)
    m.derivative(rise, (gain * heater - rise) / tau)
    m.output("temperature", "K", rise)
    places = [Path("heater", delayed=True), Balance("rise"), Path("temperature")]
    return Plant(m.model(), [Input("heater", held=True)], [Output("temperature")], places)


def recorded(seed: int) -> dict[str, np.ndarray]:
    """A heater whose power changes at every sample, `EARLY` seconds before it is written down; exact between steps."""
    random = np.random.default_rng(seed)
    power = random.uniform(0.0, 1.0, SAMPLES + 1)
    read, x = [], 10.0 * power[0]
    for k in range(SAMPLES):  # to the sample: the old power first, then the next one
        for level, seconds in ((power[k], STEP - EARLY), (power[k + 1], EARLY)):
            x = 10.0 * level + (x - 10.0 * level) * np.exp(-seconds / TAU)
        read.append(x)
    time = STEP * np.arange(1, SAMPLES + 1)
    noisy = np.array(read) + NOISE * random.standard_normal(SAMPLES)
    return {"time [s]": time, "heater [1]": power[1:], "temperature [K]": noisy}


def test_a_held_input_that_acts_before_it_is_recorded_is_found() -> None:
    plant = vessel()
    found = td.discover(td.read_recordings({name: recorded(seed) for seed, name in enumerate("abc")}, plant))
    assert [e.id for e in found.effects] == ["delay(heater)"]
    delay = found.effects[0].parameters["heater_delay"]
    assert delay.ci95[0] < -EARLY < delay.ci95[1] < -0.5
    assert abs(found.parameters["tau"].value - TAU) < 0.1
