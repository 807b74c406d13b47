"""How many steps Rodas5P tries for an error of 1e-6 in lambda_2, over neighbours of each constant of its step control.

    python tests/benchmarks/step_control.py               every constant that matters, at three values each
    python tests/benchmarks/step_control.py SAFETY        one of them

The count at that error is read off a line through (log error, log count) over tolerances from 1e-3 to 1e-8; errors are
the largest at 1501 samples against a run at 1e-11.
"""

from __future__ import annotations

import argparse

import numpy as np

from tubular_dea.emit import rodas5p
from tubular_dea.export import remembered
from tubular_dea.kernel import Kernel
from tubular_dea.model.dea import tubular_dea
from tubular_dea.protocol import Protocol

ERROR = 1e-6
NEIGHBOURS = {"SAFETY": (0.7, 0.8, 0.9), "GROWTH_ROOT": (10, 11, 12), "RESOLVED": (1e-10, 1e-8, 1e-6)}
P = 12665.59  # Pa, 95 mmHg
BEAT = np.linspace(0, 15, 1501)
CASES = {
    "step": Protocol.of([0, 0.1, 0.5, 0.5, 15], pressure=[0, P, P, P, P], voltage=[0, 0, 0, 4e3, 4e3]),
    "ramp": Protocol.of([0, 5, 15], pressure=[0, P, P], voltage=[4e3] * 3),
    "snap-through": Protocol.of([0, 10, 15], pressure=[0, 14500, 14500], voltage=[7e3] * 3),
    "beats": Protocol.of(BEAT, pressure=12e3 + 2e3 * np.sin(7.5 * BEAT), voltage=np.where(BEAT % 0.83 < 0.3, 5e3, 0.0)),
}


def kernel_with(name: str, value: float) -> Kernel:
    """The tube, compiled with another value of one constant."""
    setattr(rodas5p, name, value)
    remembered.fingerprint = lambda: f"{name}={value}"  # not the library of the package as it is
    return Kernel(tubular_dea())


def tried(kernel: Kernel, protocol: Protocol) -> float:
    """Steps tried for an error of ERROR."""
    times = np.linspace(0, 15, 1501)
    exact = kernel.simulate(protocol, times, tolerance=1e-11)["lambda_2"]
    points = []
    for tolerance in np.logspace(-3, -8, 16):
        found = kernel.simulate(protocol, times, tolerance=tolerance)
        points.append((np.max(np.abs(found["lambda_2"] - exact)), found.steps + found.rejected))
    error, count = np.log(np.array(points)).T
    slope, offset = np.polyfit(error, count, 1)
    return float(np.exp(offset + slope * np.log(ERROR)))


def main() -> None:
    """Print a row for each value."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*NEIGHBOURS, []], help="constants (all)")
    names = parser.parse_args().names or NEIGHBOURS
    declared = {name: getattr(rodas5p, name) for name in NEIGHBOURS}
    print(f"{'':24}" + "".join(f"{case:>14}" for case in CASES))
    for name in names:
        for value in NEIGHBOURS[name]:
            for other, usual in declared.items():
                setattr(rodas5p, other, usual)
            kernel = kernel_with(name, value)
            print(f"{name:14}{value:<10g}" + "".join(f"{tried(kernel, p):14.0f}" for p in CASES.values()))


if __name__ == "__main__":
    main()
