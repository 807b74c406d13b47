"""Variables: what a slave knows of its model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

INF = math.inf
Vector = Sequence[float]


class SlaveVariable(NamedTuple):
    """A variable of modelDescription.xml; its value reference is its place in `VARIABLES`, from 1 on."""

    name: str
    unit: str
    kind: str  # TIME, INPUT, OUTPUT, STATE, DERIVATIVE, PARAMETER or FOLD
    place: int  # in the tuple of its kind
    type: str  # Real, Integer or Boolean
    variability: str
    minimum: float
    maximum: float
    start: float
    needs_fold: bool  # its value needs the fold of the equilibrium curve


class Curve(NamedTuple):
    """The equilibrium curve load = f(unknown): see `fold_point` and `rest_state`."""

    load: int  # the input that is the load
    switch: int  # the parameter that starts the model on the curve
    moved_by: tuple[int, ...]  # the inputs that move the curve
    lower: float  # the branch in use begins here,
    fold_lower: float  # its fold is sought from here
    upper: float  # to here
