"""Which channel explains a residual best: a latent input in each, free to be any smooth function of what acts there.

Independent of the catalogue. Electrical: the voltage at the electrodes, as a function of voltage and stretch, and its
lags. Mechanical: a hoop stress over stretch, rate and the stretch's past. Pressure path: a pressure over the recorded
one and its lags. Sensor: a reading over the true one and its lags. Each is a set of linear terms, scored like any
other candidate (`bank`); a channel's evidence is Akaike's, for none of these laws is quite the true one.

A disturbance from outside is a function of nothing recorded. A wave betrays its channel by where it is large: as the
tube answers to a wave of that channel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy

from ..identify.drive import joined
from ..identify.fit import Fit
from ..identify.misfit import BLOCK, block_sums, parts
from ..model.declare import Model, Quantity, State
from ..model.effects import CHANNELS, Effect
from ..model.effects._signals import added, at_rest, at_start, electrodes, sensor, wall_pressure
from ..model.smooth import magnitude, positive_part, ramp
from ..protocol import Protocol
from . import bank
from .compiled import Ids
from .study import Piece, Study

WAVES = 12  # cosines over a signal's range: fine enough for wavy laws
LAGS = {"electrical": (0.01, 0.1, 1.0), "mechanical": (0.03, 0.3, 3.0), "pressure": (0.01, 0.1), "sensor": (0.01, 0.1)}
VISCOUS_RATES = (0.02, 0.2, 2.0)  # 1/s
MEMORIES = (0.02, 0.1, 0.5)  # of stretch
WAVE_PRESSURE, WAVE_SHARE = 50.0, 0.005  # Pa, and part of the voltage: small waves
FULL_STRETCH, FULL_VOLTAGE, FULL_PRESSURE, FULL_READING = 0.6, 8e3, 2e4, 9e-3


@dataclass(frozen=True)
class Localisation:
    """Evidence of every channel (Akaike's: half the gain less one a term), and the channel that has most.

    `gains` are the sums of squares explained; `disturbance` is True where a function of recorded signals explains
    little and the place was found by where the residual is large.
    """

    channel: str
    evidence: dict[str, float]
    gains: dict[str, float]
    disturbance: bool


def localise(study: Study, ids: Ids, fitted: Fit, excess: float) -> Localisation:
    """The channel in which the residual of `fitted` arises; `excess` is what of it is not noise."""
    listed = bank.candidates(study, fitted, ids, [latent(c) for c in CHANNELS])
    found = bank.scores(listed, fitted.residual, fitted.jacobian)
    gains = {s.candidate.effect.channel: s.gain for s in found}
    evidence = {s.candidate.effect.channel: 0.5 * s.gain - len(s.candidate.names) for s in found}
    best = max(evidence, key=lambda c: evidence[c])
    if gains[best] >= 0.5 * excess:
        return Localisation(best, evidence, gains, False)
    outside = disturbance(study, ids, fitted)
    return Localisation(max(outside, key=lambda c: outside[c]), outside, gains, True)


def disturbance(study: Study, ids: Ids, fitted: Fit) -> dict[str, float]:
    """Log likelihood ratio, by channel, of an unrecorded disturbance that enters there over none.

    It is taken as a wave at the residual's strongest frequency, with an amplitude and a phase of its own in every
    piece; what enters by pressure or voltage reaches the sensor as the tube answers at that frequency.
    """
    pieces = study.training
    residuals = parts(fitted.residual, [p.record for p in pieces])
    frequency = _strongest(residuals, pieces)
    result = {}
    for channel, name in (("sensor", ""), ("pressure", "pressure"), ("electrical", "voltage")):
        gained = 0.0
        for piece, residual in zip(pieces, residuals, strict=True):
            columns = np.column_stack(_swings(study, ids, fitted, piece, name, frequency))
            white = study.noise.whiten(piece.case.times, columns) * piece.weight[:, None]
            basis, _ = np.linalg.qr(white / np.maximum(np.linalg.norm(white, axis=0), 1e-12))
            gained += float(np.sum((basis.T @ residual) ** 2)) if np.abs(white).max() > 1e-9 else 0.0
        result[channel] = 0.5 * gained
    return result


def _strongest(residuals: Sequence[np.ndarray], pieces: Sequence[Piece]) -> float:
    """The frequency [Hz] that is strongest in the residuals of some pieces, summed over them."""
    means = block_sums(residuals)
    step = BLOCK * float(np.median(np.diff(pieces[0].case.times)))
    power = np.abs(np.fft.rfft(means - means.mean())) ** 2
    rough = float(np.fft.rfftfreq(means.size, step)[1 + int(np.argmax(power[1:]))])
    grid = rough + np.linspace(-0.1, 0.1, 81)
    found = np.zeros(grid.size)
    for piece, part in zip(pieces, residuals, strict=True):
        found += np.abs(np.exp(-2j * np.pi * np.outer(grid, piece.case.times)) @ part) ** 2 / part.size
    return float(max(grid[int(np.argmax(found))], 0.02))


def _swings(
    study: Study, ids: Ids, fitted: Fit, piece: Piece, name: str, frequency: float
) -> list[np.ndarray]:
    """What a small wave of an input does to the reading (n,), in two phases; of the sensor where `name` is empty."""
    phases = (0.0, 0.5 * np.pi)
    if not name:
        return [np.sin(2 * np.pi * frequency * piece.case.times + phase) for phase in phases]
    kernel, values = study.compiled.kernel(ids), study.geometry | fitted.values
    protocol, times = piece.case.protocol, piece.case.times
    still = kernel.simulate(protocol, times, values)[study.measured]
    waved = [_waved(protocol, name, frequency, phase) for phase in phases]
    return [(kernel.simulate(w, times, values)[study.measured] - still) * 1e6 for w in waved]


def _waved(protocol: Protocol, name: str, frequency: float, phase: float) -> Protocol:
    """The protocol with a small wave added to the pressure, or multiplied to the voltage."""
    fine = np.arange(protocol.time[0], protocol.time[-1], 1 / (16 * frequency))
    names = list(protocol.inputs)
    fitting = joined([(protocol.time, protocol.inputs[n]) for n in names] + [(fine, fine)], [*names, "fine"])
    wave = np.sin(2 * np.pi * frequency * fitting.time + phase)
    inputs = {n: fitting.inputs[n] for n in names}
    inputs[name] = inputs[name] + (WAVE_PRESSURE * wave if name == "pressure" else WAVE_SHARE * wave * inputs[name])
    return Protocol(fitting.time, inputs)


# Latent inputs as effects --------------------------------------------------------------------------------------


def latent(channel: str) -> Effect:
    """The latent input of a channel as a candidate; all its terms are linear and off at zero."""
    terms, apply = _LATENT[channel]
    parameters = tuple(Quantity(f"latent_{channel}_{i}", "1", f"Latent term {i}", 0.0) for i in range(terms))
    names = [q.name for q in parameters]
    return Effect(f"latent_{channel}", channel, "Anything that acts there", apply, parameters,
                  off=dict.fromkeys(names, 0.0), typical=dict.fromkeys(names, 1.0))  # fmt: skip


def _waves(signal: sympy.Expr, full: float) -> list[sympy.Expr]:
    return [sympy.cos(sympy.Float(np.pi * k / full) * signal) - 1 for k in range(1, WAVES + 1)]


def _sum(model: Model, channel: str, terms: list[sympy.Expr], first: int = 0) -> sympy.Expr:
    return sum((model[f"latent_{channel}_{i}"] * t for i, t in enumerate(terms, first)), sympy.Integer(0))


def _lagging(model: Model, channel: str, signal: sympy.Expr, unit: str, start: sympy.Expr, rest: sympy.Expr,
             nominal: float) -> tuple[Model, list[sympy.Expr]]:  # fmt: skip
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
    laws = [(600.0, "sigma_hoop", hoop),
            (0.05 * 745e3, "sigma_eta", [model["dlambda_1_dlambda_2"] * speed * f for f in (*fast, stretch - 1)]),
            (0.01 * 333e3, "dW_dI_1", [sympy.tanh(below / sympy.Float(w)) for w in MEMORIES])]  # fmt: skip
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
