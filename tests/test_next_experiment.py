"""What is proposed to measure next tells models apart though their parameters are fitted to it too."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shared_data import shared
from tubular_dea.discover import engine
from tubular_dea.discover.answer import outcome
from tubular_dea.discover.experiments import next_experiment
from tubular_dea.discover.experiments.next_experiment import Proposal
from tubular_dea.discover.search import equivalence
from tubular_dea.identify.records.data import read_folder
from tubular_dea.plants.tube import PLANT


@pytest.fixture(scope="module")
def lagging() -> engine.Discovery:
    """lab-2: the electrodes charge with a lag."""
    return engine.discover(read_folder(shared("lab/lab-2"), PLANT))


@pytest.mark.long
def test_a_lag_of_the_electrodes_is_confirmed_by_switching_the_voltage(lagging: engine.Discovery) -> None:
    """A sweep of the pressure was proposed: there two models differ by 240 standard deviations, of which their own
    parameters take all but 28."""
    assert lagging.proposal is not None
    assert lagging.proposal.words.startswith("voltage steps of 10 ms")
    assert 30 < lagging.proposal.deviations < 150


@pytest.mark.long
def test_what_the_recordings_tell_as_well_is_not_proposed(
    lagging: engine.Discovery, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of slow pressure triangles alone, none tells as much as the voltage steps that were recorded."""
    options = [lagging.chosen, lagging.search.rivals[0]]
    slow = {w: p for w, p in next_experiment.feasible(lagging.study).items() if w.startswith("slow pressure")}
    monkeypatch.setattr(next_experiment, "feasible", lambda study: slow)
    assert next_experiment.propose(lagging.study, options) is None
    assert next_experiment.propose(lagging.study, options[:1]) is None


@pytest.mark.long
def test_an_experiment_is_proposed_as_often_as_it_takes(lagging: engine.Discovery) -> None:
    """Two effects are told apart by a share of what they gain, however little noise there is."""
    name = lagging.chosen.ids[0]
    unsure = replace(lagging, verdict="ambiguous", equivalent={name: ["amplifier_slew"]})
    least = equivalence.told_apart(lagging.chosen, lagging.chosen_gains[name])
    said = {}
    for times in (0.9, 2.5, 9.5):
        weak = Proposal("steps", discrimination=least / times / 2)
        said[times] = outcome.advice(replace(unsure, proposal=weak))
    assert "record steps, which distinguishes" in said[0.9]
    assert "record steps 3 times, each of which distinguishes" in said[2.5]
    assert "no experiment" in said[9.5]
