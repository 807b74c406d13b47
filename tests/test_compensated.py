"""What parameters leave of an effect that they make up for, against fits of recordings that have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind import bench
from tubular_dea.discover.recalibration import recalibrated
from tubular_dea.discover.scores.bank import candidates_at
from tubular_dea.discover.scores.compensated import Compensation
from tubular_dea.discover.scores.power import _left
from tubular_dea.identify.fitting.fit import Fit, fit
from tubular_dea.identify.records.data import read_folder
from tubular_dea.identify.study.common_nuisances import common_nuisances
from tubular_dea.identify.study.study import PRIOR, Study, study
from tubular_dea.plants.tube import PLANT

FEW = ["02_step_4kV", "03_step_6kV", "04_ramp_7kV", "05_pressure_steps", "08_heartbeat_5kV"]


@pytest.fixture(scope="module")
def tube(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Fit]:
    """A study of recordings with nothing hidden, and its fit."""
    folder = tmp_path_factory.mktemp("tube") / "data"
    bench.write(bench.draw(11, "none"), folder, 11, FEW)
    return recalibrated(study(read_folder(folder, PLANT), (), PRIOR), 1, False)


@pytest.mark.parametrize(
    ("name", "parameter", "size", "least_error"),
    [
        ("stretch_dependent_viscosity", "eta_stretch", 3.0, 0.2),
        ("pressure_gain", "pressure_gain", 0.1, 1.0),
        ("clamp_compliance", "clamp_compliance", 0.3, 0.5),
        ("passive_layer_stiffness", "mu_passive", 8e4, 0.2),
        ("charge_trapping", "trap_fraction", 0.02, -0.2),
    ],
)
def test_what_is_left_is_what_a_fit_leaves(
    tube: tuple[Study, Fit], name: str, parameter: str, size: float, least_error: float
) -> None:
    """Without noise; the linear model errs by more than `least_error`."""
    work, fitted = tube
    effect = work.catalogue[name]
    shape = {n: values[len(values) // 2] for n, values in effect.shapes.items()}
    points = {name: [(shape, {parameter: size})]}
    (chord,) = candidates_at(work, fitted.values, fitted.residual.size, points=lambda one: list(points.get(one.id, [])))
    chord = replace(chord, columns=size * chord.columns[:, :1])
    common = common_nuisances(work)
    held = np.linalg.qr(common.beside(fitted.jacobian))[0]

    def left(columns: np.ndarray) -> float:
        return _left(replace(chord, columns=common.apply(columns)), held)

    compensation = Compensation(work, fitted, common)
    kernel = compensation.kernels[name]
    scaled, column = compensation.moved(chord, {parameter: size}, compensation.outputs(kernel, fitted.values))
    made = compensation.of({name: chord}, {name: {parameter: size}})[name]
    np.testing.assert_array_equal(made.columns, column)

    problem = compensation.problem
    read = compensation.outputs(kernel, problem.values(scaled) | shape | {parameter: effect.off[parameter] + size})
    best = fit(replace(problem, records=read, prior=None), fitted.values)
    assert left(column) == pytest.approx(best.cost, rel=0.25)
    assert left(chord.columns) > (1 + least_error) * best.cost
