"""Run one FMU in one importer, in a process of its own.

    python importers.py IMPORTER FMU INPUTS.npy RESULT.npy

`INPUTS.npy` holds one row `time [s], pressure [Pa], voltage [V]` per communication point, the last
of them the stop time; each row is held during the step that starts there. `RESULT.npy` receives
rows `time [s], lambda_2 [1]`, the time being the one the FMU has reached.

A process of its own, because importers load their own C++ runtimes, keep the FMU's library open
and, when an FMU misbehaves, take the interpreter down with them.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

INPUTS = ("pressure", "voltage")
OUTPUT = "lambda_2"
NANOSECONDS = 1_000_000_000


def run_fmpy(fmu: Path, inputs: np.ndarray) -> np.ndarray:
    """FMPy, the reference. It interpolates inputs, but is exact at a communication point."""
    from fmpy import simulate_fmu

    columns = [("time", float), *((name, float) for name in INPUTS)]
    result = simulate_fmu(
        str(fmu),
        fmi_type="CoSimulation",
        stop_time=inputs[-1, 0],
        output_interval=inputs[1, 0],
        input=np.array([tuple(row) for row in inputs], dtype=columns),
        output=[OUTPUT],
    )
    return np.column_stack([result["time"], result[OUTPUT]])


def run_ecos(fmu: Path, inputs: np.ndarray) -> np.ndarray:
    """ecos: inputs are written before the step, outputs read after it; it adds up its time."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        structure.add_model("tube", str(fmu))
        start = {f"tube::{name}": float(value) for name, value in zip(INPUTS, inputs[0, 1:], strict=True)}
        structure.add_parameter_set("start", start)
        with EcosSimulation(structure=structure, step_size=inputs[1, 0]) as simulation:
            simulation.init(parameter_set="start")
            rows = [(simulation.get_time(), simulation.get_real(f"tube::{OUTPUT}"))]
            for held in inputs[:-1, 1:]:
                for name, value in zip(INPUTS, held, strict=True):
                    simulation.set_real(f"tube::{name}", value)
                simulation.step()
                rows.append((simulation.get_time(), simulation.get_real(f"tube::{OUTPUT}")))
            simulation.terminate()
    return np.array(rows)


def run_libcosim(fmu: Path, inputs: np.ndarray) -> np.ndarray:
    """libcosim: an override manipulator holds the inputs, the clock counts whole nanoseconds.

    It initialises the FMU inside its first step, so the first row is the end of that step.
    """
    from libcosimpy._internal import get_last_error_message
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(round(inputs[1, 0] * NANOSECONDS))
    slave = CosimLocalSlave(str(fmu), "tube")
    if not slave.ptr():
        raise RuntimeError(f"libcosim does not load {fmu}: {get_last_error_message()}")
    tube = execution.add_local_slave(slave)
    reference = {
        variable.name.decode(): variable.reference
        for variable in execution.slave_variables(tube)
        if variable.type == CosimVariableType.REAL.value
    }
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    held_references = [reference[name] for name in INPUTS]
    for vr, value in zip(held_references, inputs[0, 1:], strict=True):
        execution.real_initial_value(tube, vr, value)

    rows = []
    for held in inputs[:-1, 1:]:
        manipulator.slave_real_values(tube, held_references, list(held))
        if not execution.step():
            raise RuntimeError(f"libcosim stopped: {get_last_error_message()}")
        time = execution.status().current_time / NANOSECONDS
        rows.append((time, observer.last_real_values(tube, [reference[OUTPUT]])[0]))
    return np.array(rows)


def run_pathsim(fmu: Path, inputs: np.ndarray) -> np.ndarray:
    """pathsim: at its time t the block takes the step from t to t + h and shows the result at once.

    So what pathsim records at t is the FMU at t + h, and the last one is a step past the stop time.
    """
    from pathsim import Connection, Simulation
    from pathsim.blocks import Scope, Source
    from pathsim_fmi import CoSimulationFMU

    step = inputs[1, 0]
    tube = CoSimulationFMU(str(fmu), start_values=dict(zip(INPUTS, inputs[0, 1:], strict=True)), dt=step)

    def held(column: int) -> Callable[[float], float]:
        # pathsim adds up its time, so the nearest row is meant, not the last one passed.
        return lambda time: inputs[round(time / step), column]

    sources = [Source(held(column)) for column in (1, 2)]
    scope = Scope()
    connections = [Connection(source, tube[name]) for source, name in zip(sources, INPUTS, strict=True)]
    connections.append(Connection(tube[OUTPUT], scope))
    simulation = Simulation([*sources, tube, scope], connections, dt=step, log=False)
    simulation.run(inputs[-1, 0], adaptive=False)
    time, (values,) = scope.read()
    return np.column_stack([time + step, values])[:-1]


IMPORTERS = {"fmpy": run_fmpy, "ecos": run_ecos, "libcosim": run_libcosim, "pathsim": run_pathsim}


def main(importer: str, fmu: str, inputs: str, result: str) -> None:
    """Run `fmu` in `importer` and store its trajectory in `result`."""
    np.save(result, IMPORTERS[importer](Path(fmu), np.load(inputs)))


if __name__ == "__main__":
    main(*sys.argv[1:])
