"""The monitors' noise: it drives the model, and must not be mistaken for an effect.

The part of a monitor's noise that cannot be separated from its signal moves the model's output slowly (a few um on a
bench). So samples at which the output is sensitive to the inputs weigh less: their variance is that of the sensor plus
that of the monitors times the squared static gain, both at low frequencies, where effects are sought. An output that
depends on rates (a current) has almost no static gain; for it, the variance is found by simulation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..identify.drive import joined
from ..identify.monitor_uncertainty import constant_gains
from ..identify.monitors import halved, polyline
from ..identify.problem import whitened
from ..identify.response import Case
from ..identify.study import Piece, Study

# Set by judgement. Check: `python -m blind.score --nulls 12 --conventions current --seed 1000`
TRIED = 2  # [1] times that noise is tried out
WIDE = 25  # [samples] over which what it does is averaged


def weighted(study: Study, values: Mapping[str, float]) -> Study:
    """The study with every sample weighted by the sensor's share of its standard deviation."""
    added = _input_variance(study, values)
    study = replace(study, pieces=[replace(p, input_variance=s) for p, s in zip(study.pieces, added, strict=True)])
    return study.weighted(weights(study, input_gains(study, values)))


def weights(study: Study, gains: Mapping[str, list[np.ndarray]]) -> list[np.ndarray]:
    """The weight of every sample (N,), one array a piece: the sensor's share of its standard deviation."""
    result = []
    for i, piece in enumerate(study.pieces):
        slow = np.concatenate([np.full(r.times.size, study.noise[r.output].slow) for r in piece.case.readings])
        added = sum((study.monitor_noise[name] * gain[i]) ** 2 for name, gain in gains.items())
        result.append(1 / np.sqrt(1 + np.maximum(added / slow**2, piece.input_variance)))
    return result


def _input_variance(study: Study, values: Mapping[str, float]) -> list[np.ndarray]:
    """The variance that the monitors' noise adds to every whitened sample (N,) of outputs that depend on rates."""
    feeling = {o.name for o in study.plant.outputs if o.jumps}
    found = [np.zeros(p.record.size) for p in study.pieces]
    chosen = [i for i, p in enumerate(study.pieces) if feeling & {r.output for r in p.case.readings}]
    pieces = [study.pieces[i] for i in chosen]
    still = study.response((), pieces).outputs(values)
    for number in range(TRIED):
        cases = [_noisy(p, np.random.default_rng([i, number])) for i, p in zip(chosen, pieces, strict=True)]
        for i, piece, a, b in zip(chosen, pieces, study.asked((), cases).outputs(values), still, strict=True):
            squares = whitened(piece.case, a - b, study.noise) ** 2 / TRIED
            for reading, part in zip(piece.case.readings, piece.case.parts(), strict=True):
                if reading.output in feeling:
                    found[i][part] += np.convolve(squares[part], np.ones(WIDE) / WIDE, mode="same")
    return found


def _noisy(piece: Piece, random: np.random.Generator) -> Case:
    """The case with continuous inputs as estimated from another realisation of their monitors' noise."""
    times, protocol = piece.case.readings[0].times, piece.case.protocol
    lines = {name: (protocol.time, values) for name, values in protocol.inputs.items()}
    for name in piece.driven.corners:
        level = piece.driven.noise[name]
        values = protocol.at(times)[name] + level * random.standard_normal(times.size)
        line = halved(times, values, polyline(times, values, level))
        early, late = protocol.time < times[0], protocol.time > times[-1]
        known = protocol.inputs[name]
        lines[name] = (
            np.concatenate([protocol.time[early], times[line.corners], protocol.time[late]]),
            np.concatenate([known[early], line.values, known[late]]),
        )
    return replace(piece.case, protocol=joined(list(lines.values()), list(lines)))


def coloured_rms(study: Study, gains: Mapping[str, list[np.ndarray]]) -> dict[str, float]:
    """The rms that the monitors' noise causes in every output [SI], up to the plant's own bandwidth."""
    total: dict[str, list[float]] = {name: [0.0, 0.0] for name in study.noise}
    for i, piece in enumerate(study.pieces):
        for reading, rows in zip(piece.case.readings, piece.case.parts(), strict=True):
            step = float(np.median(np.diff(reading.times)))
            share = min(1.0, 2 * study.plant.bandwidth * step)
            squares = sum(float(np.sum((study.monitor_noise[n] * g[i][rows]) ** 2)) for n, g in gains.items())
            total[reading.output][0] += share * squares
            total[reading.output][1] += reading.times.size
    return {name: float(np.sqrt(squares / max(count, 1))) for name, (squares, count) in total.items()}


def input_gains(study: Study, values: Mapping[str, float]) -> dict[str, list[np.ndarray]]:
    """The static gains of every piece: output over a constant added to each monitor, each (N,)."""
    response = study.response((), study.pieces)
    noisy = [name for name, level in study.monitor_noise.items() if level > 0]
    return {name: constant_gains(response, values, name) for name in noisy}
