"""What may hide in a tube: the catalogue's ids of design.md, and things that are in no library.

Each has a number in tube.c, where its equation stands, and the ranges that its numbers a, b, c are drawn from. Forms
and sizes are this bench's own; nothing here comes from the package.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Hidden:
    """One thing that may hide: its number in tube.c, where it acts, and the ends its numbers are drawn between."""

    number: int
    channel: str
    ranges: tuple[tuple[float, float], ...]
    either_sign: bool = False  # of the first number


def _effect(number: int, channel: str, *ranges: tuple[float, float], either_sign: bool = False) -> Hidden:
    return Hidden(number, channel, ranges, either_sign)


EFFECTS: dict[str, Hidden] = {
    "electrode_resistance": _effect(1, "electrical", (6e-3, 30e-3)),  # s
    "amplifier_slew": _effect(2, "electrical", (8e4, 4e5)),  # V/s
    "charge_trapping": _effect(3, "electrical", (0.02, 0.06), (0.5, 4.0)),  # share, s
    "stretch_dependent_permittivity": _effect(4, "electrical", (0.15, 0.4)),
    "field_dependent_permittivity": _effect(5, "electrical", (-0.3, -0.12), (5e7, 9e7)),  # share, V/m
    "permittivity_drift": _effect(29, "electrical", (0.04, 0.15), (5.0, 40.0), either_sign=True),  # share, s
    "rate_dependent_viscosity": _effect(6, "mechanical", (-0.6, -0.25), (0.03, 0.2)),  # exponent, 1/s
    "stretch_dependent_viscosity": _effect(7, "mechanical", (1.5, 4.0)),
    "hoop_viscoelasticity": _effect(8, "mechanical", (8e3, 3e4), (0.1, 1.0), (0.0, 3e2)),  # Pa, s, Pa s
    "third_maxwell_branch": _effect(9, "mechanical", (4e6, 1e7), (0.02, 0.08)),  # Pa, s
    "mullins_softening": _effect(10, "mechanical", (0.05, 0.2), (0.02, 0.1)),
    "friction_hysteresis": _effect(11, "mechanical", (1e3, 5e3), (3e-3, 2e-2)),  # Pa, 1
    "permanent_set": _effect(12, "mechanical", (0.03, 0.1), (0.02, 0.5)),  # share, s
    "prestretch": _effect(13, "mechanical", (1.02, 1.08)),
    "passive_layer_stiffness": _effect(14, "mechanical", (1e4, 4e4)),  # Pa
    "strain_stiffening": _effect(15, "mechanical", (2e4, 6e4), (1.0, 3.0)),  # Pa, 1
    "clamp_compliance": _effect(16, "mechanical", (0.1, 0.3)),
    "added_mass": _effect(27, "mechanical", (4.0, 30.0)),  # of the tube's own mass
    "rigid_stop": _effect(17, "mechanical", (1e5, 1e6), (2e-3, 5e-3), (1.22, 1.32)),  # Pa, 1, 1
    "thermal_softening": _effect(18, "mechanical", (0.02, 0.06), (3.0, 12.0)),  # share at 5 kV, s
    "stiffness_drift": _effect(28, "mechanical", (0.01, 0.04), (3.0, 20.0)),  # share, s
    "pressure_offset": _effect(19, "pressure", (80.0, 400.0), either_sign=True),  # Pa
    "pressure_gain": _effect(20, "pressure", (1.02, 1.06)),
    "pressure_delay": _effect(21, "pressure", (6e-3, 20e-3)),  # s
    "pneumatic_line": _effect(22, "pressure", (5e-3, 2e-2), (3e-3, 1e-2)),  # s, s
    "radius_offset": _effect(23, "sensor", (2e-5, 1e-4), either_sign=True),  # m
    "radius_gain": _effect(24, "sensor", (1.015, 1.05)),
    "sensor_lag": _effect(25, "sensor", (4e-3, 2e-2)),  # s
    "sensor_delay": _effect(26, "sensor", (6e-3, 2e-2)),  # s
    "sensor_average": _effect(40, "sensor", (8e-3, 4e-2)),  # s
    "sensor_drift": _effect(30, "sensor", (4e-5, 1.5e-4), (5.0, 40.0), either_sign=True),  # m, s
    "voltage_delay": _effect(41, "electrical", (6e-3, 20e-3)),  # s
    "slow_discharge": _effect(42, "electrical", (20e-3, 150e-3)),  # s
}
DRAWN = tuple(sorted(EFFECTS.keys() - {"slow_discharge", "voltage_delay"}))  # those that seeds have stood for
EXTERNAL: dict[str, Hidden] = {
    "odd_mechanical": _effect(31, "mechanical", (1.5e3, 4e3), (0.015, 0.03)),  # Pa, 1
    "odd_electrical": _effect(32, "electrical", (8e3, 2.5e4), (8e6, 1.5e7)),  # Pa, V/m
    "odd_pressure": _effect(33, "pressure", (80.0, 250.0), (300.0, 700.0)),  # Pa, Pa
    "shape_along_the_axis": _effect(34, "mechanical", (0.85, 1.3)),  # how firm the ends are
    "leak": _effect(35, "pressure", (4.0, 14.0), (0.05, 0.3)),  # Pa^1/2, s
    "hydrostatic_column": _effect(36, "pressure", (300.0, 1500.0), (0.7, 2.5)),  # Pa, Hz
    "laser_on_the_cap": _effect(37, "sensor", (0.08, 0.3), (0.3, 0.8)),  # of the stretch, squared
    "cracked_electrode": _effect(38, "electrical", (0.1, 0.35), (1.19, 1.25)),  # share of the area, stretch
    "gas_temperature": _effect(39, "pressure", (0.01, 0.04), (0.6, 4.0)),  # share, s
}
EVERYTHING = EFFECTS | EXTERNAL
TABLE_ROWS = 43  # in tube.c: N_EFFECTS


def channel(name: str) -> str:
    """Where an effect, or something in no library, acts."""
    return EVERYTHING[name].channel
