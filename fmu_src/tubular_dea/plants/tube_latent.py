"""The latent inputs of the tube: in each channel any smooth function of the signals there (input estimation).

Electrical: the voltage at the electrodes, as a function of voltage and stretch, and its lags. Mechanical: a hoop stress
over stretch, rate and the stretch's past. Pressure path: a pressure over the recorded one and its lags. Sensor: a
reading over the true one and its lags. All terms are linear and off at zero, so they are scored like any effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import sympy

from ..model.change import added, at_rest, at_start
from ..model.declare import Model, Quantity, State
from ..model.effect import Effect
from ..model.smooth import magnitude, positive_part, ramp
from .effects._signals import electrodes, sensor, wall_pressure

WAVES = 12  # cosines over a signal's range: fine enough for wavy laws
LAGS = {"electrical": (0.01, 0.1, 1.0), "mechanical": (0.03, 0.3, 3.0), "pressure": (0.01, 0.1), "sensor": (0.01, 0.1)}
VISCOUS_RATES = (0.02, 0.2, 2.0)  # 1/s
MEMORIES = (0.02, 0.1, 0.5)  # of stretch
FULL_STRETCH, FULL_VOLTAGE, FULL_PRESSURE, FULL_READING = 0.6, 8e3, 2e4, 9e-3


def latent(channel: str) -> Effect:
    """The latent input of a channel as a candidate; all its terms are linear and off at zero."""
    terms, apply = _LATENT[channel]
    parameters = tuple(Quantity(f"latent_{channel}_{i}", "1", f"Latent term {i}", 0.0) for i in range(terms))
    names = [q.name for q in parameters]
    return Effect(
        f"latent_{channel}",
        channel,
        "Anything that acts there",
        apply,
        parameters,
        off=dict.fromkeys(names, 0.0),
        typical=dict.fromkeys(names, 1.0),
    )


def _waves(signal: sympy.Expr, full: float) -> list[sympy.Expr]:
    return [sympy.cos(sympy.Float(np.pi * k / full) * signal) - 1 for k in range(1, WAVES + 1)]


def _sum(model: Model, channel: str, terms: list[sympy.Expr], first: int = 0) -> sympy.Expr:
    return sum((model[f"latent_{channel}_{i}"] * t for i, t in enumerate(terms, first)), sympy.Integer(0))


def _lagging(
    model: Model, channel: str, signal: sympy.Expr, unit: str, start: sympy.Expr, rest: sympy.Expr, nominal: float
) -> tuple[Model, list[sympy.Expr]]:
    """The model with lags of a signal as states, and how far each is behind."""
    behind = []
    for i, tau in enumerate(LAGS[channel]):
        q = Quantity(f"latent_{channel}_lag_{i}", unit, "Lagging signal", nominal=nominal)
        model = model.extend(states=[State(q, (signal - q.symbol) / sympy.Float(tau), start, rest)])
        behind.append((q.symbol - signal) / sympy.Float(nominal))
    return model, behind


def _electrical(model: Model) -> Model:
    model = electrodes(model)
    source = model.expression("electrode_voltage")
    voltage, stretch = model["voltage"], (model["lambda_2"] - 1) / sympy.Float(0.3)
    v = voltage / sympy.Float(FULL_VOLTAGE)
    model, behind = _lagging(model, "electrical", voltage, "V", voltage, voltage, 5e3)
    waves = _waves(v * model["lambda_1"] * model["lambda_2"], 2.0)
    relative = [v * w for w in waves] + [v * stretch, v * stretch**2, *behind]
    scale = sympy.Float(0.02 * 5e3)
    return model.replace("electrode_voltage", source + scale * _sum(model, "electrical", relative))


def _mechanical(model: Model) -> Model:
    stretch, speed = model["lambda_2"], model["lambda_2_rate"]
    model, behind = _lagging(model, "mechanical", stretch, "1", model["lambda_2_start"], stretch, 0.1)
    model, below = _below_largest(model)
    fast = [sympy.tanh(magnitude(speed) / sympy.Float(v)) for v in VISCOUS_RATES]
    hoop = [*_waves(stretch - 1, FULL_STRETCH), speed, sympy.tanh(speed / sympy.Float(0.02)), *behind]
    laws = [
        (600.0, "sigma_hoop", hoop),
        (0.05 * 745e3, "sigma_eta", [model["dlambda_1_dlambda_2"] * speed * f for f in (*fast, stretch - 1)]),
        (0.01 * 333e3, "dW_dI_1", [sympy.tanh(below / sympy.Float(w)) for w in MEMORIES]),
    ]
    first = 0
    for scale, name, terms in laws:
        model = added(model, name, sympy.Float(scale) * _sum(model, "mechanical", terms, first))
        first += len(terms)
    return model


def _below_largest(model: Model) -> tuple[Model, sympy.Expr]:
    """The model with the largest stretch so far as a state, and how far the stretch is below it."""
    largest, stretch = Quantity("latent_largest", "1", "Largest stretch so far"), model["lambda_2"]
    grows = ramp(stretch - largest.symbol, 1e-5) / sympy.Float(5e-3)
    model = model.extend(states=[State(largest, grows, model["lambda_2_start"], stretch)])
    return model, positive_part(largest.symbol - stretch)


def _pressure(model: Model) -> Model:
    model = wall_pressure(model)
    pressure = model["pressure"]
    model, behind = _lagging(model, "pressure", pressure, "Pa", pressure, pressure, 1e4)
    terms = [sympy.Integer(1), *_waves(pressure, FULL_PRESSURE), *behind]
    return added(model, "wall_pressure", sympy.Float(20.0) * _sum(model, "pressure", terms))


def _sensor(model: Model) -> Model:
    model = sensor(model)
    reading = model["radial_displacement"]
    start, rest = at_start(model, reading), at_rest(model, reading)
    model, behind = _lagging(model, "sensor", reading, "m", start, rest, 3e-3)
    terms = [sympy.Integer(1), reading / sympy.Float(3e-3), *_waves(reading, FULL_READING), *behind]
    return added(model, "sensor_signal", sympy.Float(1e-5) * _sum(model, "sensor", terms))


_LATENT: Mapping[str, tuple[int, Callable[[Model], Model]]] = {
    "electrical": (WAVES + 2 + len(LAGS["electrical"]), _electrical),
    "mechanical": (WAVES + 2 + len(LAGS["mechanical"]) + len(VISCOUS_RATES) + 1 + len(MEMORIES), _mechanical),
    "pressure": (1 + WAVES + len(LAGS["pressure"]), _pressure),
    "sensor": (2 + WAVES + len(LAGS["sensor"]), _sensor),
}
