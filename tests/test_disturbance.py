"""The channel of an unrecorded disturbance, where a wave of an input takes the model to where it has no answer."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np
import pytest

from test_adjust import FREE, TRUTH, drawn, set_of
from tubular_dea.discover.scores import channels
from tubular_dea.identify.fitting.response import Response
from tubular_dea.identify.study.adjust import adjusted


def test_a_wave_that_the_model_cannot_follow_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tube close to its fold ended a search with an error instead of an answer."""
    work = adjusted(set_of(drawn(6, 0.02)), (), TRUTH, FREE)
    samples = sum(p.record.size for p in work.training)
    fitted = SimpleNamespace(values=TRUTH, residual=np.sin(0.1 * np.arange(samples)))
    told = channels.disturbance(work, (), fitted)
    assert told["load"] > 0
    possible = Response.possible

    def beyond(self: Response, values: Mapping[str, float]) -> list[np.ndarray | None]:
        return [possible(self, values)[0], *[None] * (len(self.cases) - 1)]

    monkeypatch.setattr(Response, "possible", beyond)
    nothing = channels.disturbance(work, (), fitted)
    assert nothing["load"] == 0 and nothing.keys() == told.keys()
