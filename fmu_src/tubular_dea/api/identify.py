"""Parameters from recordings."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..discover.alternatives.input_noise import input_sensitivities, weighted
from ..discover.scores.parameters import is_share
from ..errors import ArgumentError, list_of_names
from ..files import write_atomically
from ..identify.fitting.fit import NORMAL_95, Fit, fit, goodness, rmse, uncertainty
from ..identify.fitting.intervals import intervals, vanishing, with_coarse_residuals
from ..identify.fitting.misfit import ResidualOverNoise, residual_over_noise
from ..identify.fitting.problem import Problem
from ..identify.study import procedure
from ..identify.study.adjust import adjusted, with_starts_at
from ..identify.study.free_rings import with_slow_rings
from ..identify.study.monitor_uncertainty import with_monitor_noise
from ..identify.study.nuisances import with_nuisances
from ..identify.study.remembered import NOISE_OF
from ..identify.study.study import PRIOR, Study, study
from ..model.declare import Model, nearest
from ..model.units import in_units_of, in_words, readable
from ..plants.plant import Plant
from ..plants.saved import as_json
from . import tables
from .ended import recorded
from .given import Amount, AnyPlant, parameters_of, whole
from .recordings import Data, recordings_of
from .work import steps

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


# Set by judgement. Check: `pytest tests/test_identify.py -k no_standard_error`
UNEVEN = 1.5  # [1] times by which an interval's end may be off what its standard error says, to be told by that


@dataclass(frozen=True)
class ParameterEstimate:
    """An identified parameter in `unit`: its value, standard error, and 95 % interval (infinite where it is open)."""

    value: float
    stderr: float
    ci95: tuple[float, float]
    unit: str

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> ParameterEstimate:
        """From the form it has in parameters.json and result.json, where an open end is null."""
        low, high = content["ci95"]
        ends = (-math.inf if low is None else low, math.inf if high is None else high)
        return cls(content["value"], content["stderr"], ends, content["unit"])


def estimates_table(estimates: Mapping[str, ParameterEstimate]) -> pandas.DataFrame:
    """One row a parameter: value, stderr, low and high end of the 95 % interval, unit."""
    rows = [
        {"parameter": n, "value": e.value, "stderr": e.stderr, "low": e.ci95[0], "high": e.ci95[1], "unit": e.unit}
        for n, e in estimates.items()
    ]
    return tables.table(rows, "parameter")


@dataclass(frozen=True, repr=False)
class IdentificationResult:
    """Identified parameters: `model` at their values, the `study` they were found in, the `fit`.

    `content` is that of parameters.json, in SI units.
    """

    model: Model
    study: Study
    fit: Fit
    content: Mapping[str, Any]

    def __repr__(self) -> str:
        return f"<IdentificationResult: {self.study.plant.name}, {self.verdict}, fit {self.fit_percent:.2f} %>"

    @property
    def verdict(self) -> str:
        """``"adequate"``, or ``"misfit"`` where more than noise is left."""
        return str(self.content["verdict"])

    @property
    def parameters(self) -> dict[str, ParameterEstimate]:
        """The identified parameters by name."""
        return {name: ParameterEstimate.of(p) for name, p in self.content["parameters"].items()}

    @property
    def fit_percent(self) -> float:
        """Goodness of fit, 100 (1 - |y - yhat| / |y - mean(y)|)."""
        return float(self.content["fit_percent"])

    @property
    def rmse(self) -> float:
        """Root mean square error of the first output, in its SI unit."""
        return float(self.content["rmse"])

    def lines(self) -> list[str]:
        """The parameters and the goodness of fit as text."""
        vague = self.content["undetermined"]
        said, fits = [_estimate(name, p, name in vague) for name, p in self.parameters.items()], []
        each = self.content.get("outputs", {"": self.content})
        for name, e in each.items():
            said_of = f"{name}: " if name else ""
            fits.append(f"{said_of}fit {e['fit_percent']:.2f} %, error {in_units_of(e['rmse'], e)}")
        return [*said, "(+- standard error; 95 % intervals in parameters.json)", *fits, *self.remarks()]

    def remarks(self) -> list[str]:
        """Warnings about the values."""
        said = []
        if not self.content["converged"]:
            said.append("the search has not converged: give more starts, or another start")
        if self.content["undetermined"]:
            said.append(f"not determined by these recordings: {', '.join(self.content['undetermined'])}")
        for name, end in self.content["at_bounds"].items():
            if end == "largest" and is_share(self.model.quantity(name)):
                continue
            said.append(
                f"{name} ended at the {end} value that the model allows, {_bound(self.model, name, end)}: its interval "
                "is open there, and something else may be missing that it compensates for"
            )
        if self.verdict == "misfit":
            said.append(
                f"the model lacks something{self._zeros_of_its_own()}: the slow part of the misfit is "
                f"{self.content['residual_over_noise_slow']:.2f} times what noise and sampling allow, and all of it "
                f"{self.content['residual_over_noise']:.2f} times (the sensor's noise: "
                f"{in_units_of(self.content['noise_floor'], self.content)}), so the intervals are too narrow"
            )
        if self.content["slow_noise_unknown"]:
            said.append(
                "no stretch rests long enough in these recordings to tell how slow the noise is: with slow noise the "
                "model explains them, without it the model lacks something, and the intervals are too narrow; record "
                "longer ones, in which nothing moves"
            )
        return said

    def _zeros_of_its_own(self) -> str:
        """That sensors may have zeros for which a search would ask, where the plant declares none."""
        if not self.study.assumable:
            return ""
        example = self.study.assumable[0]
        return (
            f", or sensors have zeros, of which the plant declares none (zero=... for {example}, as close-loop finds)"
        )

    def to_pandas(self) -> pandas.DataFrame:
        """One row a parameter: value, stderr, low and high end of the 95 % interval, unit. Needs the extra `tables`."""
        return estimates_table(self.parameters)

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values, as parameters.json has it."""
        return dict(self.content)

    def plot(self, figure: Figure | None = None) -> Figure:
        """The experiment with the largest misfit: record, model and residual; drawn into `figure` if it is given."""
        from ..report.fit import worst_fit

        return worst_fit(self.study, self.fit, self.content["per_experiment"], figure)

    def report(self, out: str | Path) -> list[Path]:
        """Write parameters.json, model.json and fit.png to the folder `out`; returns their paths."""
        from ..report.figures import png

        saved = as_json(self.model, "identified", uncertainty(self.fit, self.model), self.study.plant)
        content = {
            "fit.png": png(self.plot()),
            "model.json": saved.encode(),
            "parameters.json": (json.dumps(self.content, indent=2, allow_nan=False) + "\n").encode(),
        }
        return [write_atomically(Path(out) / name, data) for name, data in content.items()]


def _bound(model: Model, name: str, end: str) -> str:
    """The least or the largest allowed value of a parameter, with its unit."""
    q = model.quantity(name)
    return f"{q.minimum if end == 'least' else q.maximum:g} {q.unit}".removesuffix(" 1")


def identify(
    data: Data,
    plant: AnyPlant = "tube",
    *,
    start: str | Mapping[str, Amount] | None = None,
    staged: bool = False,
    free: Sequence[str] | None = None,
    starts: int = 3,
    seed: int = 0,
    profile: bool = False,
    progress: bool = False,
) -> IdentificationResult:
    """The model's parameters from recordings, all of them jointly, with their intervals.

    Parameters
    ----------
    data : str, Path or RecordingSet
        A folder of recordings, or what `read_recordings` has read.
    plant : Plant, str or Path
        The recorded plant, where `data` is a folder.
    start : str or mapping of str to float or str, optional
        Starting values: those of the plant by name, such as ``"table-2"``, or your own (default: as declared).
    staged : bool
        Begin with the plant's stages, as the paper does (always done from named starting values).
    free : sequence of str, optional
        The parameters to identify (default: all tunable ones).
    starts : int
        Number of starts of the joint fit, near the starting values.
    seed : int
        Seed of these starts.
    profile : bool
        Intervals from the profile of the likelihood (minutes).
    progress : bool
        Show a bar on standard error.

    Returns
    -------
    IdentificationResult
        Parameters with intervals, the verdict on the fit, and the model at these values.

    Raises
    ------
    UserError
        For invalid recordings or arguments, and where the model cannot be solved.

    Examples
    --------
    >>> import numpy as np
    >>> import tubular_dea as td
    >>> run = td.simulate(td.tube(C_1="340 kPa"), pressure="ramp 0 95 mmHg from 0 to 1",
    ...                   voltage="step 0 5 kV at 2", stop=4)
    >>> noise = 15e-6 * np.random.default_rng(1).standard_normal(run.time.size)
    >>> table = {"time [s]": run.time, "pressure [Pa]": run["pressure"], "voltage [V]": run["voltage"],
    ...          "radius [m]": run["radius"] + noise}
    >>> found = td.identify(td.read_recordings({"ramp and step": table}), free=["C_1"], starts=1)
    >>> low, high = found.parameters["C_1"].ci95
    >>> found.verdict, low < 340e3 < high
    ('adequate', True)

    Source: the paper's Section III for the stages; least squares with analytic sensitivities.
    """
    whole(starts, 1, "starts")
    whole(seed, 0, "seed")
    free = None if free is None else list_of_names("free", free)
    recordings = recordings_of(data, plant)
    known = recordings.plant
    if staged and not known.stages:
        raise ArgumentError("staged", f": the plant {known.name} declares no stages to begin with; leave this out")
    values = known.model.parameter_values() | _start(known, start)
    with recorded(known), steps(progress, None) as tell, threadpool_limits(limits=1):  # more are six times slower
        tell("monitors and noise")
        work = with_slow_rings(study(recordings, held_out=(), prior=PRIOR, effects=False))
        if any(work.unknown((), p) for p in work.pieces):  # a fit must not depend on where the plant starts
            sought = procedure.free_parameters(known.model, values, free)
            work = adjusted(work, (), work.shared(values), sought, started=False)
        if staged or isinstance(start, str):
            values = procedure.staged(work, values, tell)
        tell("all parameters jointly")
        work, problem, best = procedure.alternating_fit(work, values, starts, seed, free)
        tell("intervals")
        work = with_starts_at(work, (), best.values)
        problem, best = vanishing(work.problem((), problem.free, problem.fixed), best)
        best = with_monitor_noise(problem, best, work.training, work.monitor_noise)
        best = with_coarse_residuals(best, [r.size for r in problem.records])
        content = _content(work, problem, best, profile)
    names = known.model.parameter_values()
    identified = {n: v for n, v in (work.geometry | best.values).items() if n in names}
    return IdentificationResult(known.model.with_values(identified), work, best, content)


def _start(plant: Plant, start: str | Mapping[str, Amount] | None) -> dict[str, float]:
    """Values to begin with: the plant's of that name, or those given."""
    if not isinstance(start, str):
        return parameters_of(plant.model, start, "start")
    if start not in plant.starts:
        raise ArgumentError(
            "start", f" {start}: {plant.name} has no such starting values{nearest(start, plant.starts)}"
        )
    return dict(plant.starts[start])


def _content(work: Study, problem: Problem, best: Fit, profile: bool) -> dict[str, Any]:
    """The content of parameters.json, in SI units."""
    model, left, first = work.plant.model, _misfit(work, problem, best), work.plant.outputs[0].name
    answers = problem.response.outputs(best.values)
    outputs = [with_nuisances(work, p, y, without=NOISE_OF) for p, y in zip(work.training, answers, strict=True)]
    parameters = {
        name: {
            "value": best.values[name],
            "stderr": best.stderr[name],
            "unit": model.quantity(name).unit,
            "ci95": [e if math.isfinite(e) else None for e in ends],
        }
        for name, ends in intervals(problem, best, profile).items()
    }
    errors = {name: _errors(work, outputs, name) for name in work.noise}
    return {
        "verdict": "misfit" if left.significant else "adequate",
        "residual_over_noise": left.ratio,
        "residual_over_noise_slow": left.blocks,
        "residual_slow_z": left.slow,
        "slow_noise_unknown": left.may_be_slow_noise,
        "parameters": parameters,
        "undetermined": best.undetermined(),
        "at_bounds": {name: "least" if side < 0 else "largest" for name, side in best.at_bounds().items()},
        "converged": best.converged,
        "intervals": "profile likelihood" if profile else "covariance, or profile likelihood where that is not normal",
        **errors[next(iter(errors))],
        "noise_floor": work.noise[first].rms,
        "noise_correlation": work.noise[first].neighbours,
    } | ({"outputs": errors} if len(errors) > 1 else {})


def _misfit(work: Study, problem: Problem, best: Fit) -> ResidualOverNoise:
    """How the residual compares with noise, where that of the monitors, which drive the model, counts as such: where
    more is left, also that of a fit in which samples weigh as this makes them, as another one leaves more than it has
    to."""
    judged = weighted(work, input_sensitivities(work, best.values)).problem((), best.free, problem.fixed)
    left = residual_over_noise(judged, replace(best, residual=judged.residuals(best.scaled)))
    return residual_over_noise(judged, fit(judged, best.values)) if left.significant else left


def _errors(work: Study, answers: Sequence[np.ndarray], output: str) -> dict[str, Any]:
    """The error of one output (SI) and the goodness of fit, of all experiments that have it and of each."""
    pairs = {
        piece.name: (piece.record[part], answer[part])
        for piece, answer in zip(work.training, answers, strict=True)
        for reading, part in zip(piece.case.readings, piece.case.parts, strict=True)
        if reading.output == output
    }
    records, models = zip(*pairs.values(), strict=True)
    each = {name: {"rmse": rmse([r], [y]), "fit_percent": goodness([r], [y])} for name, (r, y) in pairs.items()}
    return {
        "rmse": rmse(records, models),
        "fit_percent": goodness(records, models),
        **work.plant.quantity(output).units,
        "per_experiment": each,
    }


def _estimate(name: str, told: ParameterEstimate, vague: bool = False) -> str:
    """A parameter with its standard error, in a unit that suits the larger of the two; or with its interval, where that
    is no 1.96 of them to both sides; or the one end that is known of it; or the value alone of what is `vague`."""
    for end, words in zip(told.ci95, ("above", "below"), strict=True):
        if math.isfinite(end) and not all(map(math.isfinite, told.ci95)):
            return f"{name:8s} {words} {in_words(end, told.unit)} (95 %)"
    if vague:
        return f"{name:8s} {in_words(told.value, told.unit)}, not determined"
    scale, unit = readable(max(abs(told.value), told.stderr if np.isfinite(told.stderr) else 0.0), told.unit)
    half = NORMAL_95 * told.stderr
    if np.isfinite(half) and any(not half / UNEVEN < abs(end - told.value) < half * UNEVEN for end in told.ci95):
        low, high = (f"{end / scale:.6g}" for end in told.ci95)
        return f"{name:8s} {told.value / scale:.6g} {unit}".removesuffix(" 1") + f", {low} to {high} (95 %)"
    return f"{name:8s} {told.value / scale:.6g} +- {float(f'{told.stderr / scale:.2g}'):g} {unit}".removesuffix(" 1")
