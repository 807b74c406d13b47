"""What a base lacks may hide in its parameters: the effects that make these plausible are said."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import made_up
from tubular_dea.discover.answer import remarks
from tubular_dea.discover.options.options import Option
from tubular_dea.discover.search import restored as module
from tubular_dea.discover.search.restored import restored, restoring
from tubular_dea.kernel import KernelError
from tubular_dea.plants.tube import PLANT

STUDY = SimpleNamespace(plant=PLANT, catalogue=PLANT.catalogue)
STRAINED = ("C_3", "eta_2")


@pytest.mark.parametrize(
    ("tried", "told"),
    [
        ({"third_maxwell_branch": (5.0, ["C_3"])}, {"third_maxwell_branch": ["eta_2"]}),
        ({"third_maxwell_branch": (5.0, [])}, {"third_maxwell_branch": ["C_3", "eta_2"]}),
        ({"third_maxwell_branch": (50.0, [])}, {}),  # explains less than the base
        ({"third_maxwell_branch": (5.0, ["C_3", "eta_2"])}, {}),  # makes nothing plausible
        ({"third_maxwell_branch": (5.0, ["C_3", "k_1"])}, {}),  # or something else implausible
        ({"sensor_drift": (5.0, []), "stiffness_drift": (-40.0, ["C_3"])}, {"stiffness_drift": ["eta_2"]}),
        ({"sensor_drift": (5.0, []), "stiffness_drift": (0.0, [])}, dict.fromkeys(["stiffness_drift", "sensor_drift"])),
    ],
)
def test_effects_that_make_parameters_plausible_are_named(
    monkeypatch: pytest.MonkeyPatch, tried: dict[str, tuple[float, list[str]]], told: dict[str, list[str] | None]
) -> None:
    options = [(STUDY, made_up.option(name, excess=excess)) for name, (excess, _) in tried.items()]
    far = {id(one.fitted): tried[one.ids[0]][1] for _, one in options}
    monkeypatch.setattr(module, "begun_as_declared", lambda study, base: options)
    monkeypatch.setattr(module, "implausible", lambda plant, fitted: far[id(fitted)])
    found = restored(STUDY, made_up.option(), STRAINED)
    assert list(found) == list(told)
    assert all(told[name] in (None, plausible) for name, plausible in found.items())


def test_nothing_is_named_where_the_declared_values_have_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def beyond(study: object, base: Option) -> list[tuple[object, Option]]:
        raise KernelError("there is no rest state to start at")

    monkeypatch.setattr(module, "begun_as_declared", beyond)
    assert restored(STUDY, made_up.option(), STRAINED) == {}


def test_what_may_hide_is_said() -> None:
    alone = SimpleNamespace(study=STUDY, named=SimpleNamespace(ids=()))
    said = remarks._restoring(alone, "third_maxwell_branch", ["eta_2"])
    assert "With third_maxwell_branch (" in said and "eta_2 would be plausible" in said
    beside = SimpleNamespace(study=STUDY, named=SimpleNamespace(ids=("sensor_lag",)))
    said = remarks._restoring(beside, "stretch_dependent_permittivity", ["C_3"])
    assert said.startswith("Beside sensor_lag, with stretch_dependent_permittivity (the permittivity changes")


def test_beside_an_effect_options_that_were_refused_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    """A lag beside a permittivity that falls: the lag alone leaves noise, with C_3 twelve times as declared."""
    left = {"stretch_dependent_permittivity": [], "clamp_compliance": ["C_3"], "charge_trapping": ["C_1"]}
    tried = [made_up.option("sensor_lag", name, excess=5.0) for name in left]
    far = {id(one.fitted): left[one.ids[-1]] for one in tried}
    monkeypatch.setattr(module, "implausible", lambda plant, fitted: far[id(fitted)])
    assert restoring(STUDY, tried, ["C_3"]) == {"stretch_dependent_permittivity": ["C_3"]}
    assert restoring(STUDY, [], ["C_3"]) == {}
