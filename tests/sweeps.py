"""Small plans that the sweep tests share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tubular_dea.sweep.plan import Plan, make_plan


def steps(points: int = 256, outputs: list[str] | dict[str, str] | None = None, **changes: Any) -> Plan:
    """Voltage steps of a pre-stretched tube: four numbers vary; some rows cannot start."""
    content: dict[str, Any] = {
        "name": "steps",
        "outputs": outputs or ["final radial_displacement", "max electric_field", "time radius rises above 18 mm"],
        "design": {"kind": "sobol", "points": points},
        "run": {"stop": "2 s"},
        "set": {"start_at_equilibrium": True},
        "inputs": {"voltage": "step 0 {amplitude} at {on} until 1.5 s"},
        "vary": {
            "pressure": {"from": "0 mmHg", "to": "180 mmHg"},
            "amplitude": {"from": "0 kV", "to": "7 kV"},
            "on": {"from": "0.1 s", "to": "1 s"},
            "C_1": {"mean": "333 kPa", "deviation": "10 kPa"},
        },
    }
    return make_plan(content | changes)


def parts(folder: Path) -> dict[str, bytes]:
    """The Parquet parts of a result folder, byte by byte."""
    return {path.name: path.read_bytes() for path in (folder / "parts").iterdir()}
