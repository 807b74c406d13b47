"""The blind bench is right: where it and the package mean the same, they agree, ringing at the start included."""

from __future__ import annotations

import numpy as np
import pytest

from blind import bench
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import tubular_dea
from tubular_dea.plants.effects import with_effects
from tubular_dea.protocol import Protocol

SAME = {  # effect: its numbers on the bench, and the package's parameters
    (): ((), {}),
    ("pressure_offset",): ((300.0,), {"pressure_offset": 300.0}),
    ("radius_gain",): ((1.03,), {"radius_gain": 1.03}),
    ("sensor_delay",): ((0.013,), {"sensor_delay": 0.013}),
    ("sensor_lag",): ((0.013,), {"tau_sensor": 0.013, "sensor_share": 1.0}),
    ("sensor_average",): ((0.013,), {"averaging_window": 0.013, "sensor_average_share": 1.0}),
}


@pytest.mark.parametrize("ids", SAME)
def test_the_bench_agrees_with_the_kernel(ids: tuple[str, ...]) -> None:
    numbers, parameters = SAME[ids]
    tube = bench.Tube(bench.TABLE_III, {name: numbers for name in ids})
    kernel = Kernel(with_effects(tubular_dea(), ids))
    values = dict(zip(bench.NAMES, bench.TABLE_III, strict=True)) | parameters
    for name, (time, pressure, voltage, stop) in bench.protocols().items():
        expected = bench.radius(tube, (time, pressure, voltage, stop)) - bench.R_O
        times = np.arange(expected.size) / bench.RATE
        run = kernel.simulate(Protocol(time, {"pressure": pressure, "voltage": voltage}), times, values, 1e-8)
        apart = run["measured_displacement"] - expected
        assert np.sqrt(np.mean(apart**2)) < 4e-6, name
        most = 6e-5 if "sensor_average" in ids else 1.5e-6  # its law is an approximation
        assert np.max(np.abs(apart)) < most, name
