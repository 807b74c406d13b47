"""The assisted heart: actuator, ventricle with windkessel, and scheduler, wired.

::

      heart --aortic_pressure--> tube --tube_flow--> heart          the compliance loop: iterated
      heart --r_wave----------.  tube --electric_field------.
      heart --aortic_pressure--> scheduler <-------------------'    sampled at the start of each step
                                 scheduler --voltage--> tube
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..emit.variables import guid
from ..export.compile import cache_folder
from ..export.package import native_fmu
from ..export.ssp import ssp
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..model.scheduler import heartbeat_scheduler
from ..model.windkessel import aortic_windkessel, paced_windkessel
from ..protocol import Protocol
from .system import Connection, System

COUPLING = (
    Connection("heart.aortic_pressure", "tube.pressure"),
    Connection("tube.tube_flow", "heart.tube_flow"),
)
SCHEDULED = (
    Connection("scheduler.voltage", "tube.voltage"),
    Connection("heart.r_wave", "scheduler.r_wave", sampled=True),
    Connection("heart.aortic_pressure", "scheduler.aortic_pressure", sampled=True),
    Connection("tube.electric_field", "scheduler.electric_field", sampled=True),
    Connection("tube.snap_through_margin", "scheduler.snap_through_margin", sampled=True),
)
EVENTS = ("scheduler.next_event", "heart.next_r_wave")


def models(paced: bool = False) -> dict[str, Model]:
    """The three models by their part's name; `paced`: with a ventricle that is told when to beat."""
    heart = paced_windkessel() if paced else aortic_windkessel()
    return {"scheduler": heartbeat_scheduler(), "tube": tubular_dea(), "heart": heart}


def fmus(folder: Path | None = None, paced: bool = False) -> dict[str, Path]:
    """Their native FMI 2 FMUs for this machine, below `folder` (default: the cache, keyed by their content)."""
    paths = {}
    for part, model in models(paced).items():
        place = folder or cache_folder() / "fmus" / guid(model).strip("{}")
        path = place / f"{model.name}.fmu"
        paths[part] = path if folder is None and path.exists() else native_fmu(model, 2, path)
    return paths


def heart_assist(
    slaves: Mapping[str, Path],
    patient: Mapping[str, float],
    settings: Mapping[str, float] | None = None,
    pace: Protocol | None = None,
) -> System:
    """The whole loop for a patient set (SI units); `settings` by "part.variable" come on top.

    `pace` (cosim.heartbeats) makes a paced ventricle beat in place of its own cycle.
    """
    left_out = {"heart_rate"} if pace else set()
    parameters = {f"heart.{name}": value for name, value in patient.items() if name not in left_out}
    parameters |= {"tube.start_at_equilibrium": 1.0, **(settings or {})}
    connections = [*COUPLING, *SCHEDULED]
    if pace is not None:
        connections.append(Connection("ecg.pace", "heart.pace"))
    return System(slaves, connections, {"ecg": pace} if pace else {}, parameters, EVENTS)


def driven_tube(
    slaves: Mapping[str, Path],
    patient: Mapping[str, float],
    voltage: Protocol,
    settings: Mapping[str, float] | None = None,
) -> System:
    """Tube and heart alone, under a known `voltage`; nobody schedules."""
    parameters = {f"heart.{name}": value for name, value in patient.items()}
    parameters |= {"tube.start_at_equilibrium": 1.0, **(settings or {})}
    wires = [*COUPLING, Connection("drive.voltage", "tube.voltage")]
    pair = {part: slaves[part] for part in ("tube", "heart")}
    return System(pair, wires, {"drive": voltage}, parameters, ("heart.next_r_wave",))


def archive(slaves: Mapping[str, Path], path: Path, patient: Mapping[str, float], stop: float = 10.0) -> Path:
    """The whole loop as an SSP archive.

    The tube starts at rest under the pressure at the start, given as a stretch: not every tool hands connected values
    over before the start.
    """
    values = {f"heart.{name}": value for name, value in patient.items()}
    values["tube.lambda_2_start"] = rest_stretch(patient["aortic_pressure_start"])
    wires = [(c.source, c.target) for c in (*COUPLING, *SCHEDULED)]
    return ssp("HeartAssist", models(), slaves, wires, values, stop, path)


def rest_stretch(pressure: float, voltage: float = 0.0) -> float:
    """lambda_2 of the tube at rest under `pressure` [Pa] and `voltage` [V]."""
    from ..kernel import Kernel

    stretches = np.linspace(0.9, 2.0, 4001)
    load, _, (fold, _) = Kernel(tubular_dea()).curve(stretches, {"voltage": voltage})
    rising = stretches <= fold
    return float(np.interp(pressure, load[rising], stretches[rising]))
