"""tubular-dea: a tubular dielectric elastomer actuator as a co-simulation unit, and any plant beside it.

The Python interface; the command line is a few lines on top of it::

    import tubular_dea as td

    run = td.simulate(td.tube(), pressure="95 mmHg", voltage="step 0 5 kV at 1", stop=3)
    run.plot()
    run.to_pandas()

    found = td.discover(td.read_recordings("bench"))
    found.verdict, found.effects
    found.report("closed")

Numbers without a unit are in SI; texts have one, as in "5.5 kV". What a user has to correct is a `UserError`, whose
text says what was expected, what came and what to do.
"""

from __future__ import annotations

import sys

__version__ = "0.1.0"

TYPE_CHECKING = False  # type checkers take it for true, and importing typing would cost more than the rest
if TYPE_CHECKING:
    from types import ModuleType
    from typing import Any

    from .api.assist import AssistResult, assist
    from .api.build import build_fmu, build_fmus
    from .api.compare import ComparisonResult, compare
    from .api.discover import DiscoveryResult, FoundEffect, discover
    from .api.identify import IdentificationResult, ParameterEstimate, identify
    from .api.models import add_effects, load, load_plant, save, tube
    from .api.pages import AtlasPage, WebPage, atlas_page, handbook_page, lab_page
    from .api.patient import PatientResult, fit_patient, patient
    from .api.pulse import PulseResult, best_pulse
    from .api.recordings import RecordingSet, read_recordings
    from .api.simulate import SimulationResult, simulate
    from .api.sweep import SweepResult, sweep
    from .errors import UserError
    from .kernel import Kernel, Trajectory
    from .model.declare import Model
    from .plants.plant import Plant
    from .protocol import Protocol
else:
    ModuleType = type(sys)

# Where each name comes from. Nothing is imported before it is used: the command line and the pythonfmu slave, which
# live in this package, start at once.
_HOME = {
    "AssistResult": "api.assist",
    "AtlasPage": "api.pages",
    "RecordingSet": "api.recordings",
    "ComparisonResult": "api.compare",
    "DiscoveryResult": "api.discover",
    "ParameterEstimate": "api.identify",
    "FoundEffect": "api.discover",
    "IdentificationResult": "api.identify",
    "Kernel": "kernel",
    "Model": "model.declare",
    "PatientResult": "api.patient",
    "Plant": "plants.plant",
    "Protocol": "protocol",
    "PulseResult": "api.pulse",
    "SimulationResult": "api.simulate",
    "SweepResult": "api.sweep",
    "Trajectory": "kernel",
    "UserError": "errors",
    "WebPage": "api.pages",
    "add_effects": "api.models",
    "assist": "api.assist",
    "atlas_page": "api.pages",
    "best_pulse": "api.pulse",
    "build_fmu": "api.build",
    "build_fmus": "api.build",
    "compare": "api.compare",
    "discover": "api.discover",
    "fit_patient": "api.patient",
    "handbook_page": "api.pages",
    "identify": "api.identify",
    "lab_page": "api.pages",
    "load": "api.models",
    "load_plant": "api.models",
    "patient": "api.patient",
    "read_recordings": "api.recordings",
    "save": "api.models",
    "simulate": "api.simulate",
    "sweep": "api.sweep",
    "tube": "api.models",
}

__all__ = [
    "AssistResult",
    "AtlasPage",
    "ComparisonResult",
    "DiscoveryResult",
    "FoundEffect",
    "IdentificationResult",
    "Kernel",
    "Model",
    "ParameterEstimate",
    "PatientResult",
    "Plant",
    "Protocol",
    "PulseResult",
    "RecordingSet",
    "SimulationResult",
    "SweepResult",
    "Trajectory",
    "UserError",
    "WebPage",
    "add_effects",
    "assist",
    "atlas_page",
    "best_pulse",
    "build_fmu",
    "build_fmus",
    "compare",
    "discover",
    "fit_patient",
    "handbook_page",
    "identify",
    "lab_page",
    "load",
    "load_plant",
    "patient",
    "read_recordings",
    "save",
    "simulate",
    "sweep",
    "tube",
]


class _Package(ModuleType):
    """The package, which keeps a public name for its function where a folder of it is called the same.

    When `tubular_dea.identify` (a folder of modules) is imported, Python binds it here; the name stays the function's.
    `import tubular_dea.sweep.plan as plan` looks for `plan` at that name: the function has the folder's attributes.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)
        elif name in self.__dict__:
            self.__dict__[name].__dict__ = value.__dict__

    def __getattr__(self, name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        import importlib

        value = getattr(importlib.import_module(f".{_HOME[name]}", self.__name__), name)
        setattr(self, name, value)
        folder = sys.modules.get(f"{self.__name__}.{name}")
        if folder:
            setattr(self, name, folder)
        return value

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *_HOME})


sys.modules[__name__].__class__ = _Package
