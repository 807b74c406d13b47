"""An upper bound of the noise: the prediction error of an autoregression of the base model's residual.

Whatever the model lacks, an autoregression predicts slow structure in the residual, but not white noise. The bound is
needed where a record has no quiet part (a circuit driven by a broadband signal): its noise estimate then contains
signal and is far too large, or has the signal's colour. In that case white noise of the size of the bound is assumed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_toeplitz

from ..identify.fit import Fit
from ..identify.noise import UNQUIET, Noise
from ..identify.study import Study

# Set by judgement. Check: `pytest tests/test_acceptance.py::test_noise_is_no_more_than_a_residual_hides_from_its_past`,
# `python -m measured.table`
TOO_MUCH = 1.25  # [1] times the bound: noise below that is left as it was estimated

# Set by judgement: no unit test tells a factor of four. Check: `python -m measured.table`
ORDER = 20  # [samples] that the autoregression looks back


def with_noise_of(study: Study, fitted: Fit) -> Study:
    """The study with the noise of every output limited to what the base model's residual allows."""
    answers = study.response((), study.training).outputs(fitted.values)
    noise = dict(study.noise)
    for name, known in study.noise.items():
        left = [
            (piece.record - answer)[part]
            for piece, answer in zip(study.training, answers, strict=True)
            for reading, part in zip(piece.case.readings, piece.case.parts(), strict=True)
            if reading.output == name
        ]
        bound = prediction_error(left)
        signal = known.form >= UNQUIET  # the signal cannot be separated from noise of its colour
        if np.isfinite(known.freedom) and bound > 0 and (signal or known.innovation > TOO_MUCH * bound):
            form = UNQUIET if signal else known.form
            noise[name] = Noise(bound, 0.0, float(sum(r.size for r in left)), hum=known.hum, form=form)
    return replace(study, noise=noise)


def prediction_error(records: list[np.ndarray]) -> float:
    """Root mean square prediction error of an autoregression over all records (each (n,))."""
    order = min(ORDER, min(r.size for r in records) // 4)
    centred = [r - r.mean() for r in records]
    total = sum(r.size for r in centred)
    lags = np.array([sum(float(r[k:] @ r[: r.size - k]) for r in centred) for k in range(order + 1)]) / total
    if lags[0] <= 0:
        return 0.0
    lags[0] *= 1 + 1e-9
    weights = solve_toeplitz(lags[:-1], lags[1:])
    return float(np.sqrt(max(lags[0] - weights @ lags[1:], 0.0)))
