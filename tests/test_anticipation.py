"""Pulses that begin before their R wave (rule 7 of the scheduler): exact on rhythms made for each case, and never
outside the rules on bigeminy, atrial fibrillation, pauses, 40 to 180 beats a minute, and recorded beats."""

from __future__ import annotations

import numpy as np
import pytest

from coupled import needs
from shared_data import shared
from test_scheduler import STEADY, annotated, last, pulses, scheduled
from tubular_dea.cosim.master import Run
from tubular_dea.protocol import Protocol

AHEAD = {"on_time": -0.06, "on_fraction": 0.0, "off_fraction": 0.35}  # 60 ms before R, to 0.28 s after it at 0.8 s
LATE = 0.15 * 0.8


def test_steady_beats_are_anticipated_exactly() -> None:
    run = scheduled(STEADY, 8.5, **AHEAD)
    # The first pulse is planned when the rhythm is learned, at the fourth R wave, and begins with it.
    expected = [(3.2, 3.48), *((r - 0.06, r + 0.28) for r in STEADY[4:])]
    assert np.allclose(pulses(run)[:7], expected, atol=1e-6)
    assert last(run, "assisted_beats") == 7
    assert last(run, "withdrawn_pulses") == 0


def test_a_pulse_late_in_the_beat_that_ends_beyond_it_says_the_same() -> None:
    run = scheduled(STEADY, 8.5, on_fraction=0.925, off_fraction=1.35)
    assert np.allclose(pulses(run), pulses(scheduled(STEADY, 8.5, **AHEAD)), atol=1e-6)


def test_a_pulse_wholly_before_its_r_is_one_in_diastole() -> None:
    run = scheduled(STEADY, 8.5, on_time=-0.3, on_fraction=0.0, off_fraction=0.0, off_time=-0.1)
    assert np.allclose(pulses(run)[:6], [(r + 0.5, r + 0.7) for r in STEADY[3:9]], atol=1e-6)


@pytest.mark.parametrize(
    ("shift", "expected"),
    [
        (-0.10, [(4.70, 4.98)]),  # early, not premature: at once
        (-0.03, [(4.74, 5.05)]),  # while the pulse is on: its end moves
        (0.08, [(4.74, 5.14)]),  # late, but not too late: held, up to max_on_time
        (0.20, [(4.74, 4.80 + LATE), (5.00, 5.28)]),  # too late: withdrawn, and another with R
    ],
)
def test_early_and_late_beats(shift: float, expected: list[tuple[float, float]]) -> None:
    """Beats every 0.8 s up to 4.0; the next one comes `shift` after 4.8."""
    run = scheduled(np.array([0.8, 1.6, 2.4, 3.2, 4.0, 4.8 + shift]), 5.4 + shift, max_on_time=0.4, **AHEAD)
    of_it = [p for p in pulses(run) if p[0] > 4.4 and p[1] < 5.35 + shift]
    assert np.allclose(of_it, expected, atol=1e-6)
    assert last(run, "withdrawn_pulses") == len(expected) - 1


def test_a_premature_beat_has_no_pulse_and_announces_none() -> None:
    times = np.array([0.8, 1.6, 2.4, 3.2, 4.0, 4.5, 5.6, 6.4])
    on = pulses(scheduled(times, 7.0, **AHEAD))
    assert not [p for p in on if 4.4 < p[0] < 5.6 - 1e-6], "neither of its own nor before the pause is over"
    assert on[-2] == pytest.approx((5.6, 5.88), abs=1e-6), "the beat after the pause has its pulse from its R"
    assert on[-1] == pytest.approx((6.34, 6.68), abs=1e-6)


def test_a_missing_beat_ends_the_announced_pulse() -> None:
    run = scheduled(np.concatenate([STEADY[:5], [6.4, 7.2, 8.0]]), 8.5, **AHEAD)
    during = [p for p in pulses(run) if 4.4 < p[0] < 6.4]
    assert np.allclose(during, [(4.74, 4.8 + LATE)], atol=1e-6)
    assert last(run, "withdrawn_pulses") == last(run, "dropouts") == 1


def test_a_veto_ends_an_announced_pulse() -> None:
    changes = np.repeat([4.75, 4.76], 2)
    field = Protocol.of([0.0, *changes, 9.0], electric_field=[0, 0, 9e7, 9e7, 0, 0])
    on = pulses(scheduled(STEADY, 8.5, step=0.005, tables={"electric_field": field}, **AHEAD))
    assert next(p for p in on if 4.7 < p[0] < 4.8)[1] == pytest.approx(4.755, abs=0.006)
    assert not [p for p in on if 4.8 < p[0] < 5.7], "and the rest of the beat has none"


def test_the_notch_ends_the_pulse_after_a_while() -> None:
    beat = np.array([(0.0, 80), (0.05, 78), (0.15, 120), (0.22, 108), (0.24, 112), (0.8, 80)])
    time = np.concatenate([beat[:, 0] + r - 0.0001 for r in 0.8 * np.arange(11)])
    values = np.tile(beat[:, 1], 11) * 133.322
    pressure = Protocol.of(np.maximum.accumulate(np.maximum(time, 0)), aortic_pressure=values)
    on = pulses(
        scheduled(
            STEADY,
            8.5,
            step=0.002,
            tables={"aortic_pressure": pressure},
            after_notch=0.03,
            **{**AHEAD, "off_fraction": 0.5},
        )
    )
    ends = on[1:6, 1] - STEADY[4:9]
    assert np.all((ends > 0.25) & (ends < 0.257)), "30 ms after the notch at 0.222 s, not at 0.4 s"
    assert np.allclose(on[1:6, 0] - STEADY[4:9], -0.06, atol=1e-6), "the notch of the beat before is no matter"


def assert_rules(run: Run, times: np.ndarray, begin: float, late: float, longest: float) -> int:
    """Every pulse belongs to a beat or was withdrawn in time; none on premature or lost ones. Returns the pulses."""
    on = pulses(run)
    assert np.all(on[:, 1] - on[:, 0] <= longest + 1e-6)
    told = run["scheduler.target_voltage"][1:] > 0
    for refusal in ("lost", "veto"):
        assert not np.any(told & (run[f"scheduler.{refusal}"][1:] > 0.5)), refusal
    early = run.time[:-1][np.diff(run["scheduler.skipped_pulses"]) > 0]
    withdrawn = 0
    for a, b in on:
        inside = times[(times >= a - 1e-6) & (times < b - 1e-6)]
        assert inside.size <= 1, "a pulse serves one beat"
        assert not np.any((early > a - 1e-6) & (early < b - 1e-6)), "none on a premature beat"
        if not inside.size:
            before = times[times < a].max()
            rr = np.interp(a + 1e-6, run.time, run["scheduler.predicted_rr"])
            assert a == pytest.approx(before + rr + begin, abs=0.011), "begun when announced"
            assert b <= before + rr + late * rr + 0.011, "withdrawn in time"
            withdrawn += 1
    assert withdrawn <= last(run, "withdrawn_pulses") + last(run, "premature_beats") + 1
    return len(on)


def rhythm(kind: str) -> np.ndarray:
    """R times [s] of two minutes."""
    random = np.random.default_rng(5)
    if kind == "bigeminy":
        rr = np.tile([0.55, 1.05], 75)
    elif kind == "fibrillation":  # no memory: RR from 0.35 to 1.2 s
        rr = 0.35 + 0.85 * random.beta(2, 3, 180)
    elif kind == "pauses":
        rr = np.where(np.arange(150) % 11 == 10, 2.2, 0.8 * (1 + 0.02 * random.standard_normal(150)))
    else:
        rr = np.full(200, 60 / float(kind)) * (1 + 0.01 * random.standard_normal(200))
    return 1 + np.cumsum(rr)


@pytest.mark.parametrize("kind", ["bigeminy", "fibrillation", "pauses", "40", "75", "120", "180"])
def test_rules_hold_in_any_rhythm(kind: str) -> None:
    times = rhythm(kind)
    times = times[times < 120]
    run = scheduled(times, 121.0, max_on_time=0.4, **AHEAD)
    count = assert_rules(run, times, -0.06, 0.15, 0.4)
    assert last(run, "beats") == times.size
    if kind.isdigit():
        assert last(run, "assisted_beats") >= times.size - 4
        ahead = times[4:-1] - pulses(run)[1 : times.size - 4, 0]
        assert np.abs(ahead - 0.06).max() < 0.06, "within the rhythm's own variation"
    else:
        assert count > 0, "some beats are assisted"
        assert last(run, "assisted_beats") < times.size - 4, "not all"


def test_rules_hold_on_record_100() -> None:
    needs("wfdb")
    times, _ = annotated(shared("ecg/100.hea").with_suffix(""))
    run = scheduled(times, 1806.0, max_on_time=0.4, **AHEAD)
    assert_rules(run, times, -0.06, 0.15, 0.4)
    assert last(run, "assisted_beats") > 0.95 * times.size
    begun = np.array([p[0] for p in pulses(run)])
    ahead = times[np.minimum(np.searchsorted(times, begun), times.size - 1)] - begun
    assert np.median(ahead[ahead < 0.2]) == pytest.approx(0.06, abs=0.01)
