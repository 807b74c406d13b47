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
from ..export.cache import cache_folder
from ..export.package import native_fmu
from ..export.ssp import ssp
from ..model.dea import tubular_dea
from ..model.declare import Model
from ..model.scheduler import heartbeat_scheduler
from ..model.tube_controller import tube_controller
from ..model.windkessel import aortic_windkessel, paced_windkessel
from ..protocol import Protocol
from .system import Connection, System

COUPLING = (Connection("heart.aortic_pressure", "tube.pressure"), Connection("tube.tube_flow", "heart.tube_flow"))
SCHEDULED = (
    Connection("scheduler.voltage", "tube.voltage"),
    Connection("heart.r_wave", "scheduler.r_wave", sampled=True),
    Connection("heart.aortic_pressure", "scheduler.aortic_pressure", sampled=True),
    Connection("tube.electric_field", "scheduler.electric_field", sampled=True),
    Connection("tube.snap_through_margin", "scheduler.snap_through_margin", sampled=True),
)
EVENTS = ("scheduler.next_event", "heart.next_r_wave")
# With a controller, the scheduler says when and the controller how much: it holds a radius during each pulse.
CONTROLLER_FIELD = 0.98  # of the scheduler's field limit: its overshoot while a pulse ends is below 1 %
CONTROLLED = (
    Connection("controller.voltage", "tube.voltage"),
    Connection("scheduler.on", "controller.enable", sampled=True),
    Connection("heart.aortic_pressure", "controller.pressure", sampled=True),
    Connection("tube.measured_displacement", "controller.displacement", sampled=True),
)


def models(paced: bool = False, tube: Model | None = None, controlled: bool = False) -> dict[str, Model]:
    """The three models by their part's name; `paced`: with a ventricle that beats at given times.

    `tube` replaces that of the paper, for example with effects that were found; `controlled`: with a controller.
    """
    heart = paced_windkessel() if paced else aortic_windkessel()
    parts = {"scheduler": heartbeat_scheduler(), "tube": tube or tubular_dea(), "heart": heart}
    return parts | ({"controller": tube_controller()} if controlled else {})


def fmus(
    folder: Path | None = None, paced: bool = False, tube: Model | None = None, controlled: bool = False
) -> dict[str, Path]:
    """Their native FMI 2 FMUs for this machine, below `folder` (default: the cache, keyed by their content)."""
    paths = {}
    for part, model in models(paced, tube, controlled).items():
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

    With a controller among the slaves, "controller.reference_radius" is the radius that is held during pulses.

    `pace` (cosim.heartbeats) makes a paced ventricle beat in place of its own cycle.
    """
    left_out = {"heart_rate"} if pace else set()
    parameters = {f"heart.{name}": value for name, value in patient.items() if name not in left_out}
    parameters |= {"tube.start_at_equilibrium": 1.0, **(settings or {})}
    if "controller" in slaves:
        parameters.setdefault("controller.field_limit", controller_field(parameters))
    connections = [*COUPLING, *(SCHEDULED if "controller" not in slaves else (*CONTROLLED, *SCHEDULED[1:]))]
    if pace is not None:
        connections.append(Connection("ecg.pace", "heart.pace"))
    # The controller's samples are no events: they fall on communication points of 1 ms, and an event shortens steps.
    return System(slaves, connections, {"ecg": pace} if pace else {}, parameters, EVENTS)


def archive(
    slaves: Mapping[str, Path],
    path: Path,
    patient: Mapping[str, float],
    stop: float = 10.0,
    radius: float | None = None,
) -> Path:
    """The whole loop as an SSP archive; with a controller among the slaves that holds `radius` [m] during pulses.

    The tube starts at rest under the pressure at the start, given as a stretch: not every tool hands connected values
    over before the start.
    """
    values = {f"heart.{name}": value for name, value in patient.items()}
    values["tube.lambda_2_start"] = rest_stretch(patient["aortic_pressure_start"])
    controlled = "controller" in slaves
    if controlled and radius is not None:
        values |= {"controller.reference_radius": radius, "controller.field_limit": controller_field({})}
    wires = [(c.source, c.target) for c in (*COUPLING, *(CONTROLLED if controlled else SCHEDULED[:1]), *SCHEDULED[1:])]
    return ssp("HeartAssist", models(controlled=controlled), slaves, wires, values, stop, path)


def controller_field(settings: Mapping[str, float]) -> float:
    """The field limit [V/m] of a controller in the loop: a little below the one at which the scheduler refuses."""
    refused = settings.get("scheduler.field_limit", heartbeat_scheduler().parameter_values()["field_limit"])
    return CONTROLLER_FIELD * refused


def rest_stretch(pressure: float, voltage: float = 0.0) -> float:
    """lambda_2 of the tube at rest under `pressure` [Pa] and `voltage` [V]."""
    from ..kernel import Kernel

    stretches = np.linspace(0.9, 2.0, 4001)
    load, _, (fold, _) = Kernel(tubular_dea()).curve(stretches, {"voltage": voltage})
    rising = stretches <= fold
    return float(np.interp(pressure, load[rising], stretches[rising]))
