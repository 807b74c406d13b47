"""How large the noise of monitors is that drives the model, where the supply wanders slowly as noise may."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from tubular_dea.discover.alternatives import input_noise
from tubular_dea.discover.alternatives.input_noise import bounded_by_outputs, input_sensitivities, told_by_outputs
from tubular_dea.discover.scores.parameters import base_parameters
from tubular_dea.identify.fitting.misfit import BLOCK
from tubular_dea.identify.inputs.drive import joined
from tubular_dea.identify.records.experiment import Experiment, Recordings
from tubular_dea.identify.study.adjust import adjusted
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.kernel import Kernel
from tubular_dea.plants.tube import PLANT
from tubular_dea.protocol import Protocol

TIME = np.arange(0, 16, 0.004)
WHITE = 25.0  # Pa
OUTPUT = PLANT.outputs[0].name


def recorded(seed: int, follows: bool, lacks: float) -> Experiment:
    """A tube under a pressure that wanders by 60 Pa within 0.3 s, or whose monitor does (unless the tube `follows`);
    the laser swings by `lacks` [m] besides."""
    random = np.random.default_rng(seed)
    keep = float(np.exp(-0.004 / 0.3))
    wander = lfilter([60 * np.sqrt(1 - keep**2)], [1, -keep], random.standard_normal(TIME.size)) * np.minimum(TIME, 1)
    level = (6000 + 900 * seed) * np.minimum(TIME, 1)
    voltage = np.where((TIME % 4 > 2) & (TIME > 1.5), 3000.0 + 500 * seed, 0.0)
    switched = np.repeat(TIME, 2)[1:], np.repeat(voltage, 2)[:-1]
    protocol = joined([(TIME, level + wander * follows), switched], ["pressure", "voltage"])
    radius = Kernel(PLANT.model).simulate(protocol, TIME)["radial_displacement"]
    monitors = {
        "pressure": level + wander + WHITE * random.standard_normal(TIME.size),
        "voltage": voltage + 4 * random.standard_normal(TIME.size),
    }
    swinging = lacks * np.sin(2 * np.pi * 0.4 * TIME + seed)
    laser = radius + swinging + 15e-6 * random.standard_normal(TIME.size)
    return Experiment(str(seed), TIME, monitors, {OUTPUT: laser}, np.arange(TIME.size))


def told(follows: bool, lacks: float = 0.0) -> tuple[Study, Study]:
    """The study of four such recordings at the true parameters, and the same with what the radius says of the noise."""
    recordings = Recordings(PLANT, [recorded(i, follows, lacks) for i in range(4)], {}, {}, "wandering")
    work = adjusted(study(recordings, held_out=(), prior=PRIOR), (), PLANT.model.parameter_values())
    values = PLANT.model.parameter_values()
    return work, told_by_outputs(work, values, input_sensitivities(work, values))


def test_a_supply_that_wanders_is_no_noise_of_its_monitor() -> None:
    """The radius follows it. It was said to be noise of 102 Pa, four times too large, and weak effects were lost."""
    before, after = told(follows=True)
    assert before.monitor_noise["pressure"] > 3 * WHITE
    assert WHITE < after.monitor_noise["pressure"] < 2 * WHITE  # corners cut a little of what bends so fast
    assert after.monitor_noise["voltage"] == before.monitor_noise["voltage"]


def test_what_the_model_lacks_is_no_noise_of_a_monitor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of four laboratory's sets with an effect, pressures had 86 to 184 Pa of noise in place of 25 to 30: what was left
    then looked like noise, and a clamp that slipped was "nothing"."""
    assert told(follows=True, lacks=10e-6)[1].monitor_noise["pressure"] < 2.5 * WHITE
    monkeypatch.setattr(input_noise, "_follows", lambda *_: True)
    assert told(follows=True, lacks=10e-6)[1].monitor_noise["pressure"] > 5 * WHITE


def test_a_monitor_that_wanders_by_itself_is_noisy() -> None:
    """The radius does not follow it: that is noise, which weighs on blocks of a tenth of a second as 300 Pa of white
    noise would. Its record alone tells how much it is over seconds."""
    before, after = told(follows=False)
    assert before.monitor_noise["pressure"] > 300.0
    assert after.monitor_noise["pressure"] == pytest.approx(60.0 * np.sqrt(BLOCK), rel=0.25)


def test_what_is_held_out_beyond_the_fold_of_the_refitted_base_tells_nothing() -> None:
    """A leaking tube was refused: its base had no rest at the first pressure of a file that took part in no fit."""
    before, _ = told(follows=True)
    last = before.pieces[-1]
    loaded = replace(last.case, protocol=Protocol.of([0, 16], pressure=[4e4, 4e4], voltage=[0, 0]))
    beyond = replace(last, held_out=True, case=replace(loaded, own={"start_at_equilibrium": 1.0}))
    values = {p.name: PLANT.model.parameter_values()[p.name] for p in base_parameters(PLANT)}
    fewer, more = (replace(before, pieces=[*before.pieces[:-1], *rest]) for rest in ([], [beyond]))
    assert more.response((), [beyond]).possible(values)[0] is None
    gains = input_sensitivities(more, values)
    level = told_by_outputs(more, values, gains).monitor_noise["pressure"]
    alone = told_by_outputs(fewer, values, {n: g[:-1] for n, g in gains.items()}).monitor_noise["pressure"]
    assert level == pytest.approx(alone, rel=0.02)
    assert bounded_by_outputs(more, values).monitor_noise["pressure"] > 0
