"""Outputs that are counted the other way, of plants whose declared values are first guesses."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tubular_dea import read_recordings
from tubular_dea.discover import engine, recalibration
from tubular_dea.discover.alternatives import backwards as backwards_module
from tubular_dea.discover.alternatives.backwards import Backwards, backwards
from tubular_dea.plants import Build, Input, Output, Path, Plant


def motor() -> Plant:
    """A lag that is declared twelve times too weak and four times too slow: as declared it misses nearly all."""
    m = Build("Motor", "A motor", "tau dw/dt = k u - w")
    u = m.input("voltage", "V", nominal=5.0)
    k = m.parameter("k", "rad/s/V", 0.25, minimum=1e-3)
    tau = m.parameter("tau", "s", 0.8, minimum=1e-3)
    w = m.state("w", "rad/s", nominal=10.0)
    m.derivative(w, (k * u - w) / tau)
    m.output("speed", "rad/s", w)
    m.output("torque", "rad/s", u * k - w)
    return Plant(
        m.model(),
        inputs=[Input("voltage", held=True)],
        outputs=[Output("speed"), Output("torque")],
        places=[Path("speed")],
    )


@pytest.mark.long
@pytest.mark.parametrize("wrong", [(), ("speed",), ("speed", "torque")])
def test_an_output_counted_the_other_way_is_found_once_the_plant_is_refitted(wrong: tuple[str, ...]) -> None:
    random, time = np.random.default_rng(3), np.arange(0, 10, 0.02)
    tables = {}
    for name, level in (("up", 5.0), ("down", -3.0), ("more", 8.0)):
        voltage = np.where((time >= 1) & (time < 6), level, 0.0)
        rise = np.clip(time - 1, 0, None)
        speed = 3.0 * level * (np.exp(-np.clip(time - 6, 0, None) / 0.2) - np.exp(-rise / 0.2))
        read = {"speed": speed, "torque": 3.0 * voltage - speed}
        noisy = {n: (-1) ** (n in wrong) * v + random.normal(0, 0.05, time.size) for n, v in read.items()}
        tables[name] = {"time [s]": time, "voltage [V]": voltage} | {f"{n} [rad/s]": v for n, v in noisy.items()}
    recordings = read_recordings(tables, plant=motor())
    prepared, work, fitted = engine._begun(recordings, 1, None, lambda what: None)
    told = backwards(prepared, work, fitted, lambda other: recalibration.recalibrated(other, 1, False)[1])
    assert (told and told.outputs) == (wrong or None)
    if told:
        assert isinstance(told, Backwards) and told.left < 0.1


def test_slow_noise_that_is_all_a_record_shows_is_no_missing_signal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice a search was repeated with signs changed, for ten minutes: 16 um of slow noise weigh as 110 white ones."""
    record, whole = np.sin(np.linspace(0, 60, 4000)), slice(0, 4000)
    case = SimpleNamespace(readings=[SimpleNamespace(output="speed")], parts=(whole,))
    piece = SimpleNamespace(record=record, weight=np.ones(4000), case=case)
    study = SimpleNamespace(training=[piece], noise={"speed": SimpleNamespace(slow=1.0)})

    monkeypatch.setattr(backwards_module, "_cost", lambda *of: 100.0)
    assert backwards(study, study, SimpleNamespace(cost=4100.0), lambda other: None) is None  # it leaves noise
    assert backwards(study, study, SimpleNamespace(cost=6000.0), lambda other: None).outputs == ("speed",)
