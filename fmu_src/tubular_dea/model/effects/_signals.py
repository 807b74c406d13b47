"""Places at which effects take hold: signals that the base model does not tell apart get a name of their own.

Each function returns the model with that signal; where it is there already, the model itself. Effects that act on
one signal form a chain: each takes the expression of the signal as it finds it.
"""

from __future__ import annotations

import sympy

from ..declare import Definition, Model, Quantity, rate


def tapped(model: Model, signal: Quantity, source: sympy.Expr, users: tuple[str, ...]) -> Model:
    """`source` under the name of `signal`, in the definitions `users` only (in the model's order)."""
    if signal.name in model.quantities():
        return model
    model = model.extend(definitions=[Definition(signal, source)], before=users[0])
    for user in users:
        model = model.replace(user, model.expression(user).subs(source, signal.symbol))
    return model


def electrodes(model: Model) -> Model:
    """`electrode_voltage` and its rate: what reaches the layers; `capacitance_rate` for the current."""
    if "electrode_voltage" in model.quantities():
        return model
    voltage = model.quantity("voltage")
    signal = Quantity("electrode_voltage", "V", "Voltage at the electrodes", nominal=5e3, display_unit="kV")
    moving = Quantity("electrode_voltage_rate", "V/s", "Its rate", nominal=5e3)
    slope = Quantity("capacitance_rate", "F/s", "Rate of the capacitance", nominal=1e-8)
    model = tapped(model, signal, voltage.symbol, ("electric_field", "charge", "current"))
    model = tapped(model, moving, rate(voltage), ("current",))
    capacitance = model["capacitance"]
    growth = (model["dlambda_1_dlambda_2"] / model["lambda_1"] + 1 / model["lambda_2"]) * model["lambda_2_rate"]
    model = model.extend(definitions=[Definition(slope, 2 * capacitance * growth)], before="current")
    return model.replace("current", capacitance * moving.symbol + signal.symbol * slope.symbol)


def dielectric(model: Model) -> Model:
    """`active_field` (what polarises the elastomer) and `eps_effective` (its relative permittivity)."""
    model = electrodes(model)
    seen = Quantity("active_field", "V/m", "Field that polarises the elastomer", nominal=5e7, display_unit="V/um")
    effective = Quantity("eps_effective", "1", "Relative permittivity in the present state")
    model = tapped(model, seen, model["electric_field"], ("sigma_maxwell",))
    return tapped(model, effective, model["eps_r"], ("sigma_maxwell", "capacitance"))


def elastic_stretches(model: Model) -> Model:
    """`lambda_1_elastic` to `lambda_3_elastic`: the stretches that the elastomer's energy is a function of."""
    if "lambda_2_elastic" in model.quantities():
        return model
    one, two, three = (Quantity(f"lambda_{i}_elastic", "1", f"Elastic stretch {i}") for i in (1, 2, 3))
    model = tapped(model, three, model["lambda_3"], ("I_1", "sigma_m", "sigma_hoop"))
    model = tapped(model, one, model["lambda_1"], ("lambda_3_elastic", "I_1", "sigma_m"))
    model = tapped(model, two, model["lambda_2"], ("lambda_3_elastic", "I_1", "sigma_hoop"))
    return model.replace(three.name, 1 / (one.symbol * two.symbol))


def wall_pressure(model: Model) -> Model:
    """`wall_pressure` (what the wall feels) and, at rest, `wall_equilibrium_pressure`."""
    if "wall_pressure" in model.quantities():
        return model
    felt = Quantity("wall_pressure", "Pa", "Pressure that the wall feels", nominal=1e4, display_unit="mmHg")
    delivered = Quantity("delivered_pressure", "Pa", "Pressure at the tube's end of the line", nominal=1e4,
                         display_unit="mmHg")  # fmt: skip
    held = Quantity("wall_equilibrium_pressure", "Pa", "Pressure that the wall holds at rest", nominal=1e4,
                    display_unit="mmHg")  # fmt: skip
    model = tapped(model, felt, model["pressure"], ("lambda_2_acceleration",))
    model = tapped(model, delivered, model["pressure"], (felt.name,))
    balance = model.expression("equilibrium_pressure")
    model = model.extend(definitions=[Definition(held, balance)], before="equilibrium_pressure")
    return model.replace("equilibrium_pressure", held.symbol)


def sensor(model: Model) -> Model:
    """`sensor_signal`: what the sensor makes of the displacement, before any delay."""
    signal = Quantity("sensor_signal", "m", "Reading of the sensor", nominal=1e-3, display_unit="mm")
    return tapped(model, signal, model["radial_displacement"], ("measured_displacement",))


def at_rest(model: Model, expression: sympy.Expr) -> sympy.Expr:
    """`expression` in inputs, parameters and the curve's unknown, every other state at its equilibrium."""
    unknown = model.curve.unknown if model.curve else None
    settled = {s.quantity.symbol: s.equilibrium for s in model.states if s.quantity.name != unknown}
    held = {rate(q): sympy.Integer(0) for q in model.inputs}
    return _expanded(model, expression).subs(settled).subs(held)


def at_start(model: Model, expression: sympy.Expr) -> sympy.Expr:
    """`expression` in inputs and parameters, every state at its start."""
    return at_rest_of_inputs(model, _expanded(model, expression).subs(
        {s.quantity.symbol: s.start for s in model.states}))  # fmt: skip


def at_rest_of_inputs(model: Model, expression: sympy.Expr) -> sympy.Expr:
    """`expression` for inputs that do not move."""
    return expression.subs({rate(q): sympy.Integer(0) for q in model.inputs})


def _expanded(model: Model, expression: sympy.Expr) -> sympy.Expr:
    """`expression` in inputs, parameters and states: definitions put in, delays left out (nothing moves)."""
    expression = sympy.sympify(expression)
    for definition in reversed(model.definitions):
        if definition.quantity.symbol in expression.free_symbols:
            expression = expression.subs(definition.quantity.symbol, definition.expression)
        for delay in model.delays:
            expression = expression.subs(delay.quantity.symbol, sympy.Symbol(delay.of, real=True))
    for delay in model.delays:
        expression = expression.subs(delay.quantity.symbol, sympy.Symbol(delay.of, real=True))
    return expression


def filtered(model: Model, signal: str, share: sympy.Expr, output: sympy.Expr, name: str) -> Model:
    """`signal` with a share of it replaced by `output`; what it was before is the definition `name`."""
    before = model.quantity(signal)
    renamed = Quantity(name, before.unit, f"{before.description}, before the lag", nominal=before.nominal,
                       display_unit=before.display_unit)  # fmt: skip
    model = model.extend(definitions=[Definition(renamed, model.expression(signal))], before=signal)
    return model.replace(signal, renamed.symbol + share * (output - renamed.symbol))


def added(model: Model, name: str, term: sympy.Expr) -> Model:
    """The definition `name` with `term` added."""
    return model.replace(name, model.expression(name) + term)


def scaled(model: Model, name: str, factor: sympy.Expr) -> Model:
    """The definition `name` times `factor`."""
    return model.replace(name, model.expression(name) * factor)


def pushed(model: Model, pressure: sympy.Expr) -> Model:
    """A radial pressure against the wall's stretching, in the equation of motion and at rest alike."""
    names = [d.quantity.name for d in model.definitions]
    surface = model["A_3"] if names.index("A_3") < names.index("F_cir") else model.expression("A_3")
    return added(model, "F_cir", pressure * surface)
