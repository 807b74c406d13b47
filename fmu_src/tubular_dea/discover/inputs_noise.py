"""The part of the noise that comes in with the monitors: it drives the model, and is no effect.

A monitor's noise that cannot be told from its signal moves the model's answer slowly (a few um on a bench), so
samples at which the answer is sensitive to the inputs weigh less: their variance is the sensor's plus the monitors'
through the static gain, both taken at low frequencies, where effects are sought.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..identify.problem import Problem
from .parameters import switched_off
from .study import Study

LEAST_VOLTAGE = 200.0  # V: below, the tube hardly feels voltage
PROBES = {"pressure": "pressure_offset"}  # effects whose parameter adds to an input


def weights(study: Study, values: Mapping[str, float]) -> list[np.ndarray]:
    """The weight of every sample (n,), one array a piece: the sensor's share of its standard deviation."""
    gains = input_gains(study, values)
    noise = study.noise
    slow = (noise.innovation / (1 - noise.correlation)) ** 2
    result = []
    for i in range(len(study.pieces)):
        added = sum((study.monitor_noise[name] * gain[i]) ** 2 for name, gain in gains.items())
        result.append(1 / np.sqrt(1 + added / slow))
    return result


def coloured_rms(study: Study, values: Mapping[str, float], bandwidth: float = 25.0) -> float:
    """What the monitors' noise leaves in the answer [SI], up to the tube's own bandwidth [Hz]."""
    gains = input_gains(study, values)
    total, count = 0.0, 0
    for i, piece in enumerate(study.pieces):
        rate = 1 / float(np.median(np.diff(piece.case.times)))
        share = min(1.0, 2 * bandwidth / rate)
        total += share * sum(float(np.sum((study.monitor_noise[n] * g[i]) ** 2)) for n, g in gains.items())
        count += piece.record.size
    return float(np.sqrt(total / max(count, 1)))


def input_gains(study: Study, values: Mapping[str, float]) -> dict[str, list[np.ndarray]]:
    """How the answer of every piece moves with each monitor, for slow errors: output over input, each (n,)."""
    from ..model.effects import catalogue

    gains: dict[str, list[np.ndarray]] = {}
    problem: Problem = study.problem((), [], values, study.pieces)
    base = problem.response.outputs(values)
    for name, probe in PROBES.items():
        if name not in study.monitor_noise:
            continue
        effect = catalogue()[probe]
        step = 0.5 * effect.typical[effect.parameters[0].name]
        moved = study.response((probe,), study.pieces).outputs(
            dict(values) | switched_off(effect) | {effect.parameters[0].name: step}
        )
        gains[name] = [(a - b) / step for a, b in zip(moved, base, strict=True)]
    if "voltage" in study.monitor_noise:
        permittivity = values["eps_r"]
        moved = problem.response.outputs(dict(values) | {"eps_r": permittivity * 1.01})
        gains["voltage"] = [
            (a - b) / 0.01 * 2 / np.maximum(np.abs(p.case.protocol.at(p.case.times)["voltage"]), LEAST_VOLTAGE)
            for a, b, p in zip(moved, base, study.pieces, strict=True)
        ]
    return gains
