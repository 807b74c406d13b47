"""Plants: a model, its recorded signals, and the places where effects may act.

Everything a plant file needs is here::

    from tubular_dea.plants import Balance, Build, Coefficient, Input, Output, Path, Plant
"""

from __future__ import annotations

from ..laws import Balance, Coefficient, Path, Place
from ..model.build import Build
from ..model.change import added, at_rest, at_start, filtered, scaled
from ..model.declare import DeclarationError, Definition, EquilibriumCurve, Model, Parameter, Quantity, State, rate
from ..model.effect import Effect
from ..model.smooth import magnitude, positive_part, ramp, root, step
from .plant import Exchange, Input, Output, Plant, Stage

__all__ = [
    "Balance",
    "Build",
    "Coefficient",
    "DeclarationError",
    "Definition",
    "Effect",
    "EquilibriumCurve",
    "Exchange",
    "Input",
    "Model",
    "Output",
    "Parameter",
    "Path",
    "Place",
    "Plant",
    "Quantity",
    "Stage",
    "State",
    "added",
    "at_rest",
    "at_start",
    "filtered",
    "magnitude",
    "positive_part",
    "ramp",
    "rate",
    "root",
    "scaled",
    "step",
]
