"""A fit that ended far from the declared values begins there once more: branches may have taken each other's place."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import tubular_dea as td
from made_up import option
from tubular_dea.discover.options.options import fitted_option
from tubular_dea.discover.scores.parameters import lost
from tubular_dea.discover.search import settle
from tubular_dea.discover.search.settle import iterated, own_nuisances
from tubular_dea.identify.records.experiment import UNKNOWN
from tubular_dea.identify.study.adjust import adjusted, with_starts_at
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.kernel import KernelError
from tubular_dea.plants.tube import PLANT

LOST = {"eta_o": 1.1e4, "k_1": 255e6, "eta_1": 7.4e5, "k_2": 3e6, "eta_2": 9.5e6, "C_2": -35e3, "C_3": 1e3}


def beats(number: int) -> dict[str, np.ndarray]:
    """Pulses of voltage at a constant pressure, from equilibrium."""
    time = np.arange(4000) / 250.0
    voltage = np.interp(np.mod(time, 0.8), [0, 0.1, 0.15, 0.4, 0.45, 0.8], [0, 0, 1, 1, 0, 0]) * (4e3 + 500 * number)
    pressure = 11e3 + 1500 * np.sin(2 * np.pi * (0.3 + 0.2 * number) * time)
    kernel = td.Kernel(PLANT.model)
    drive = td.Protocol.of(time, pressure=pressure, voltage=voltage)
    run = kernel.simulate(drive, time, {"start_at_equilibrium": 1.0})["measured_displacement"]
    read = run + 5e-6 * np.random.default_rng(number).standard_normal(time.size)
    return {"time [s]": time, "pressure [Pa]": pressure, "voltage [V]": voltage, "displacement [m]": read}


@pytest.mark.long
def test_a_lost_fit_is_found_again() -> None:
    work = study(td.read_recordings({f"beats {n}": beats(n) for n in range(3)}), [], PRIOR)
    declared = PLANT.model.parameter_values()
    astray = fitted_option(work, (), declared | LOST, ())
    assert astray is not None and lost(PLANT, astray.fitted)
    stuck = iterated(work, astray)[1]
    found = own_nuisances(work, astray)[1]
    assert found.misfit < stuck.misfit - 100
    assert not lost(PLANT, found.fitted)


def test_starts_of_states_that_only_a_model_with_an_effect_has_are_not_those_of_a_record() -> None:
    """A record that the model with the effect could not follow kept its own numbers: a traceback after a minute."""
    read = td.read_recordings({f"beats {n}": beats(n) for n in range(2)})
    read = replace(read, experiments=[replace(e, start=UNKNOWN) for e in read.experiments])
    values, ids = PLANT.model.parameter_values(), ("third_maxwell_branch",)
    work = adjusted(study(read, [], PRIOR), (), values)
    assert len(work.unknown(ids, work.pieces[0])) > len(work.unknown((), work.pieces[0])) > 0
    there = with_starts_at(work, ids, values | dict(PLANT.catalogue[ids[0]].typical))
    for before, after in zip(work.pieces, there.pieces, strict=True):
        assert after.nuisances.names == before.nuisances.names
        moved = np.any(after.nuisances.columns != before.nuisances.columns, axis=0)
        assert moved.any() and all(
            n.startswith("start") for n, m in zip(before.nuisances.names, moved, strict=True) if m
        )


def test_a_model_without_an_answer_at_the_declared_values_stays_as_it_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The declared values of a base and the size of an effect that was fitted with others may have none together."""

    def none(*_: Any, **__: Any) -> Any:
        raise KernelError("the trajectory ended")

    monkeypatch.setattr(settle, "declared_values", lambda plant, fitted: {})
    monkeypatch.setattr(settle, "as_read", lambda work, ids: work)
    monkeypatch.setattr(settle, "adjusted", none)
    one = option("lag")
    assert settle._begun_as_read(cast(Study, SimpleNamespace(plant=None)), one, {}) == []


def test_numbers_of_an_options_own_are_not_taken_where_they_fit_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    for left, turns, z_slow in (
        ([90.0, 95.0], 1, 0.0),
        ([110.0], 0, 0.0),
        ([110.0, 115.0], 1, 90.0),  # they stood for what it lacks
        ([90.0, 80.0, 80.0], 3, 0.0),
    ):
        reached = iter([option("lag", excess=e, z_slow=z_slow) for e in left])
        monkeypatch.setattr(settle, "adjusted", lambda study, ids, values, free: study + 1)
        monkeypatch.setattr(settle, "fitted_option", lambda study, ids, start, refined, r=reached: next(r))
        monkeypatch.setattr(settle, "_closer", lambda before, after: False)
        monkeypatch.setattr(settle, "_with_starts_where_it_ended", lambda *settled: settled)
        study, best = iterated(0, option("lag", excess=100.0, z_slow=z_slow))
        assert (study, best.misfit) == (turns, option("lag", excess=[100.0, *left][turns]).misfit)


@pytest.mark.parametrize(("spread", "taken"), [(1.5e-6, True), (30e-6, False)])
def test_zeros_that_stood_for_an_effect_and_hid_what_they_have_in_common_go_with_it(
    monkeypatch: pytest.MonkeyPatch, spread: float, taken: bool
) -> None:
    """What they have in common is left over then; without that, the settled option would be refused as a worse fit."""
    before = cast(Study, SimpleNamespace(spread={"radius": 178e-6}))
    after = cast(Study, SimpleNamespace(spread={"radius": spread}))
    one, worse = option("lag"), option("lag", excess=160.0)
    monkeypatch.setattr(settle, "adjusted", lambda *_: after)
    monkeypatch.setattr(settle, "fitted_option", lambda *_: worse)
    monkeypatch.setattr(settle, "_with_starts_where_it_ended", lambda *settled: settled)
    found = iterated(before, one)
    assert found == ((after, worse) if taken else (before, one))
