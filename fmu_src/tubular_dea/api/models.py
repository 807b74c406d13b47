"""Models: the tube of the paper, saved models, plants of your own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import ArgumentError, list_of_names
from ..files import write_atomically
from ..model.declare import Model
from ..model.effect import with_effects
from ..plants.plant import Plant
from ..plants.saved import as_json
from ..plants.saved import load as saved
from .given import Amount, AnyPlant, brief, parameters_of, path_of, plant_of


def tube(effects: Sequence[str] = (), **parameters: Amount) -> Model:
    """The tubular actuator of the paper, with its published parameters.

    Parameters
    ----------
    effects : sequence of str
        Effects of the tube's catalogue to add, by id and in this order; each at its usual size unless given in
        `parameters`.
    **parameters : float or str
        Values by name, in SI or as texts with a unit, including those of the effects.

    Returns
    -------
    Model
        Inputs ``pressure`` [Pa] and ``voltage`` [V]; outputs such as ``radial_displacement`` [m] and
        ``electric_field`` [V/m].

    Raises
    ------
    UserError
        For an unknown effect or parameter, and for a value outside its bounds.

    Notes
    -----
    N. Liu, T. Martinez, A. Walter, Y. Civet, Y. Perriard, "Control-oriented modeling and analysis of tubular dielectric
    elastomer actuators dedicated to cardiac assist devices", Tables I and III.

    Examples
    --------
    >>> import tubular_dea as td
    >>> stiffer = td.tube(C_1="340 kPa")
    >>> stiffer.parameter_values()["C_1"]
    340000.0
    >>> lagging = td.tube(["electrode_resistance"], tau_e="12 ms")
    >>> lagging.effects, lagging.parameter_values()["tau_e"]
    (('electrode_resistance',), 0.012)
    """
    return add_effects("tube", effects, **parameters)


def add_effects(plant: AnyPlant, effects: Sequence[str] = (), **parameters: Amount) -> Model:
    """The model of a plant with effects of its catalogue in it, and with other parameter values.

    Parameters
    ----------
    plant : Plant, str or Path
        A plant, ``"tube"``, ``"aorta"``, or ``"FILE.py[:NAME]"``.
    effects : sequence of str
        Effects to add, by id and in this order; each at its usual size unless given in `parameters`.
    **parameters : float or str
        Values by name, in SI or as texts with a unit, including those of the effects.

    Returns
    -------
    Model
        The changed model; the plant is as it was.

    Raises
    ------
    UserError
        For an unknown effect or parameter, and for a value outside its bounds.

    Examples
    --------
    >>> import tubular_dea as td
    >>> late = td.add_effects("aorta", ["flow_delay"], flow_delay="30 ms")
    >>> late.effects, late.parameter_values()["flow_delay"]
    (('flow_delay',), 0.03)
    """
    chosen, effects = plant_of(plant), list_of_names("effects", effects)
    model = with_effects(chosen.model, effects, chosen.catalogue)
    usual = {name: value for effect in effects for name, value in chosen.catalogue[effect].typical.items()}
    return model.with_values(usual | parameters_of(model, parameters))


def load(path: str | Path, plant: AnyPlant | None = None) -> Model:
    """A model that `discover` or `identify` has saved.

    Parameters
    ----------
    path : str or Path
        A ``model.json``.
    plant : Plant, str or Path, optional
        The plant of the model, if it is declared in a file of your own: the plant, or ``"FILE.py[:NAME]"``.

    Returns
    -------
    Model
        The plant's model with the effects that were found, at the identified values.

    Raises
    ------
    UserError
        For an invalid file, and for effects, parameters or units that the plant does not have.

    Examples
    --------
    >>> import tubular_dea as td
    >>> _ = td.save(td.tube(C_1="340 kPa"), "model.json")
    >>> td.load("model.json").parameter_values()["C_1"]
    340000.0
    """
    return saved(path_of(path, "path"), None if plant is None else plant_of(plant))


def save(model: Model, path: str | Path, plant: AnyPlant | None = None) -> Path:
    """Write a model as a readable file, for `load` and for the command line's ``--model``.

    Parameters
    ----------
    model : Model
        A plant's model, with effects of its catalogue and any parameter values.
    path : str or Path
        The file to write, as in ``"model.json"``.
    plant : Plant, str or Path, optional
        The plant of the model, if it is declared in a file of your own.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UserError
        Where it cannot be written.

    Examples
    --------
    >>> import tubular_dea as td
    >>> td.save(td.tube(["electrode_resistance"], tau_e="12 ms"), "lagging.json").name
    'lagging.json'
    >>> td.load("lagging.json").effects
    ('electrode_resistance',)
    """
    if not isinstance(model, Model):
        raise ArgumentError("model", f": expected a Model but was given {brief(model)}")
    text = as_json(model, plant=None if plant is None else plant_of(plant))
    return write_atomically(path_of(path, "path"), text.encode())


def load_plant(plant: str | Path) -> Plant:
    """A plant: a model, the signals it is recorded by, and the places where something may be missing.

    Parameters
    ----------
    plant : str or Path
        ``"tube"``, ``"aorta"``, or ``"FILE.py[:NAME]"`` for one of your own.

    Returns
    -------
    Plant
        With ``model``, ``inputs``, ``outputs``, ``places``, and the ``catalogue`` of all effects by id.

    Raises
    ------
    UserError
        For an unknown plant, and for an invalid file, with file and line.

    Examples
    --------
    >>> import tubular_dea as td
    >>> aorta = td.load_plant("aorta")
    >>> [signal.name for signal in aorta.inputs], [signal.name for signal in aorta.outputs]
    (['flow'], ['pressure'])
    >>> "flow_delay" in aorta.catalogue
    True
    """
    return plant_of(plant)
