"""From recordings to the effect that the model lacks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..discover import engine
from ..discover.answer import between_files, outcome, reservations
from ..errors import UserError, list_of_names
from ..files import working_folder, write_atomically
from ..identify.fitting.fit import uncertainty
from ..identify.records.experiment import Recordings
from ..identify.study.study import Piece
from ..model.declare import Model
from ..model.starts import loosened
from ..plants.saved import as_json
from . import tables
from .ended import recorded
from .given import AnyPlant, whole
from .identify import ParameterEstimate
from .recordings import Data, findings_of, folder_of, recordings_of
from .work import steps

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from .build import Platforms


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the model lacks: where it acts (`channel`), and the effects equivalent to it (`equivalent`).

    `evidence` is the log evidence relative to the model without it (None where that has no answer in some recording),
    `explained` its share of the misfit beyond noise, `parameters` are its own.
    """

    id: str
    channel: str
    equivalent: tuple[str, ...]
    evidence: float | None
    explained: float
    parameters: Mapping[str, ParameterEstimate]


@dataclass(frozen=True, repr=False)
class DiscoveryResult:
    """The result of a discovery: `model` with the named effects at the identified values, `content` as in result.json.

    `discovery` has all intermediate results.
    """

    model: Model
    discovery: engine.Discovery
    content: Mapping[str, Any]

    def __repr__(self) -> str:
        return f"<DiscoveryResult: {self.verdict}: {self.headline}>"

    @property
    def verdict(self) -> str:
        """``"no_effect"``, ``"effect_found"``, ``"ambiguous"``, ``"partly_explained"`` or ``"unexplained"``."""
        return self.discovery.verdict

    @property
    def headline(self) -> str:
        """The verdict in a sentence."""
        from ..report.close_loop import headline

        return headline(self.discovery, self.content)

    @property
    def effects(self) -> tuple[FoundEffect, ...]:
        """The effects that are named, in the order in which they were found."""
        return tuple(_effect(e) for e in self.content["effects"])

    @property
    def parameters(self) -> dict[str, ParameterEstimate]:
        """The model's own parameters, refitted together with the effects, by name."""
        return {name: ParameterEstimate.of(p) for name, p in self.content["base_parameters"].items()}

    @property
    def errors(self) -> dict[str, Any]:
        """Errors of the model as ``published``, ``recalibrated`` and ``after``, with those on held-out experiments."""
        return dict(self.content["error"])

    @property
    def next_experiment(self) -> str:
        """One sentence: what to measure next, and why."""
        return str(self.content["next_experiment"])

    def lines(self) -> list[str]:
        """Verdict and errors as text."""
        from ..report.close_loop import error_lines
        from ..report.in_short import asked_first, first_remark

        said = [f"{self.verdict}: {self.headline}", *error_lines(self.discovery, self.errors)]
        said += [
            *reservations.forced(self.discovery),
            *reservations.from_the_start(self.discovery),
            *between_files.unlike(self.discovery),
        ]
        said += between_files.assumed(self.discovery)
        said += asked_first(self.content["remarks"])
        said += first_remark(self.content["remarks"], said)
        if not self.discovery.named.ids:
            said.append("model.json and the FMU carry the recalibrated base model only")
        return [*said, *reservations.compensating(self.discovery)]

    def to_pandas(self) -> pandas.DataFrame:
        """One row a parameter: those of the named effects, then the model's own. Needs the extra `tables`."""
        rows = [
            {"parameter": name, "effect": effect, "value": e.value, "stderr": e.stderr}
            | {"low": e.ci95[0], "high": e.ci95[1], "unit": e.unit}
            for effect, own in [*((f.id, f.parameters) for f in self.effects), ("", self.parameters)]
            for name, e in own.items()
        ]
        return tables.table(rows, "parameter")

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values, as result.json has it."""
        return dict(self.content)

    def plot(self, figure: Figure | None = None) -> Figure:
        """The residuals of every experiment, before and after; drawn into `figure` if it is given."""
        from ..report.residuals import residuals

        return residuals(self.discovery, figure)

    def report(self, out: str | Path, platforms: Platforms = "host") -> list[Path]:
        """Write result.json, report.html, lab.html, model.json and the FMU to the folder `out`; returns their paths.

        Everything is made before the first file is written; where something cannot be made, result.json and model.json
        are written alone. `platforms` are those of the FMU, as in `build_fmu`.
        """
        from ..lab.opened import closed_loop
        from ..lab.page import page
        from ..report import close_loop
        from .build import build_fmu

        out, found = Path(out), self.discovery
        recordings, before = found.recordings, found.base.fitted.values
        called = {"model": str(out / "model.json"), "data": folder_of(recordings)}
        pieces = reversed(found.named_study.pieces)  # of parts of a recording, the first tells where it begins
        begins = {p.source: _begun_alone(p, found.study.plant.model) for p in pieces}
        shown_model = loosened(self.model) if found.study.compiled.loose else self.model

        def built() -> bytes:
            with working_folder("the FMU") as folder:
                return build_fmu(self.model, folder / f"{self.model.name}.fmu", platforms=platforms).read_bytes()

        text = json.dumps(self.content, indent=2, allow_nan=False) + "\n"
        covariance = uncertainty(found.named.fitted, self.model)
        note = f"identified from {recordings.source} ({self.verdict})"
        saved = as_json(self.model, note, covariance, recordings.plant)
        try:
            with ThreadPoolExecutor(2) as pool:  # the compilers of both work beside the report
                compiled = pool.submit(built)
                shown = pool.submit(lambda: page(closed_loop(recordings, shown_model, before, called, begins)))
                written = close_loop.report(found, self.to_dict())
                lab, fmu = shown.result(), compiled.result()
        except Exception as problem:  # a full disk: what was found took longer than what shows it
            write_atomically(out / "model.json", saved.encode())
            write_atomically(out / "result.json", text.encode())
            kept = f"what was found is kept in {out / 'result.json'} and {out / 'model.json'}"
            if isinstance(problem, UserError):
                raise UserError(f"{problem}; {kept}") from problem
            problem.add_note(kept)
            raise
        paths = [write_atomically(out / "fmi2" / f"{self.model.name}.fmu", fmu)]
        paths.append(write_atomically(out / "model.json", saved.encode()))
        paths.append(written.write(out / "report.html"))
        paths.append(write_atomically(out / "lab.html", lab.encode("utf-8")))
        return [*paths, write_atomically(out / "result.json", text.encode())]


def discover(
    data: Data,
    plant: AnyPlant = "tube",
    *,
    hold_out: Sequence[str] | None = None,
    seed: int | None = None,
    progress: bool = False,
) -> DiscoveryResult:
    """Find the effects that a model lacks, from recordings.

    Parameters
    ----------
    data : str, Path or RecordingSet
        A folder of recordings, or what `read_recordings` has read.
    plant : Plant, str or Path
        The recorded plant, where `data` is a folder.
    hold_out : sequence of str, optional
        Experiments that take part in no fit (default: chosen).
    seed : int, optional
        Seed of the starts of fits and of the bootstrap; the same recordings and seed give the same result.
    progress : bool
        Show a bar on standard error.

    Returns
    -------
    DiscoveryResult
        The verdict, the named effects with their parameters, errors before and after, and the model with the effects.

    Raises
    ------
    UserError
        For invalid recordings or arguments, and for too few samples.

    References
    ----------
    C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50: the score statistic of a candidate.

    Examples
    --------
    An aorta with a delayed flow probe, recorded three times. Only effects of the flow probe are candidates here:

    >>> from dataclasses import replace
    >>> import numpy as np
    >>> import tubular_dea as td
    >>> aorta = td.load_plant("aorta")
    >>> probe = replace(aorta, places=aorta.places[:1], own={})
    >>> late = td.add_effects(probe, ["flow_delay"], flow_delay="30 ms", p_C_start="75 mmHg")
    >>> noise, tables = np.random.default_rng(3), {}
    >>> for name, peak in {"low": 2e-4, "middle": 3e-4, "high": 4e-4}.items():
    ...     flow = [0, peak, 0, 0, 1.5 * peak, 0, 0, peak, 0, 0]
    ...     run = td.simulate(late, td.Protocol.of([0, 0.1, 0.3, 0.9, 1.0, 1.3, 1.7, 1.8, 2.0, 3.0], flow=flow))
    ...     read = run["pressure"] + 30 * noise.standard_normal(run.time.size)
    ...     tables[name] = {"time [s]": run.time, "flow [m3/s]": run["flow"], "pressure [Pa]": read}
    >>> found = td.discover(td.read_recordings(tables, probe))
    >>> found.effects[0].id, found.effects[0].channel
    ('flow_delay', 'flow probe')
    >>> f"{1e3 * found.effects[0].parameters['flow_delay'].value:.0f} ms"
    '30 ms'
    """
    chosen = engine.SEED if seed is None else whole(seed, 0, "seed")
    hold_out = None if hold_out is None else list_of_names("hold_out", hold_out)
    recordings = recordings_of(data, plant)
    with recorded(recordings.plant), steps(progress, None) as tell:
        found = engine.discover(recordings, tell, chosen, hold_out)
        tell("model and report")
        content = outcome.result(found)
        content["remarks"] = [*_asked_before(recordings), *content["remarks"]]
        return DiscoveryResult(outcome.final_model(found), found, content)


MOST_ASKED = 6  # questions before the search that its result repeats


def _asked_before(recordings: Recordings) -> list[str]:
    """What was asked and told before the search, for whoever reads nothing but its result."""
    from ..report.in_short import QUESTION, TOLD

    questions = findings_of(recordings)
    told = [
        f"{QUESTION if '?' in said else TOLD}{said}{'' if said.endswith('?') else '.'}"
        for said in questions[:MOST_ASKED]
    ]
    more = len(questions) - len(told)
    return [*told, f"{more} more of these: close-loop --dry-run lists them."] if more > 0 else told


def _begun_alone(piece: Piece, model: Model) -> dict[str, float]:
    """Where a recording begins that the lab shows alone: one that follows another at equilibrium with its inputs."""
    if piece.before is None or model.curve is None:
        return dict(piece.case.own)
    return {**piece.case.own, model.curve.start_switch: 1.0}


def _effect(content: Mapping[str, Any]) -> FoundEffect:
    parameters = {name: ParameterEstimate.of(p) for name, p in content["parameters"].items()}
    return FoundEffect(
        content["id"],
        content["channel"],
        tuple(content["equivalent"]),
        content["evidence"],
        content["explained"],
        parameters,
    )
