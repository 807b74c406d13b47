"""The public functions of `tubular_dea`: their examples, their results, their errors, and what importing them costs."""

from __future__ import annotations

import ast
import dataclasses
import doctest
import functools
import inspect
import os
import re
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tubular_dea as td
from tubular_dea.cli import main
from tubular_dea.commands import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path(td.__file__).parent
RESULTS = sorted(name for name in td.__all__ if name.endswith("Result"))
FUNCTIONS = sorted(name for name in td.__all__ if inspect.isfunction(getattr(td, name)))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder beside the examples' data."""
    (tmp_path / "cosim_examples").symlink_to(ROOT / "cosim_examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


OUTSIDE = {"Path", "Driven", "None"}  # types in docstrings of other libraries, and what `Kernel.driven` gives
EXAMPLES = [*FUNCTIONS, "Kernel", "Kernel.simulate", "Kernel.derivatives", "Protocol.of"]


def public(name: str) -> Any:
    return functools.reduce(getattr, name.split("."), td)


@pytest.mark.long
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_of_every_function_runs(name: str, folder: Path) -> None:
    (example,) = doctest.DocTestFinder(recurse=False).find(public(name), name, globs={})
    assert example.examples, f"{name} has no example"
    assert doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(example).failed == 0


@pytest.mark.parametrize("name", [*EXAMPLES, "Kernel.parameters", "Kernel.mesh", "Kernel.jacobian", "Kernel.curve"])
def test_every_argument_is_documented(name: str) -> None:
    thing = public(name)
    text = inspect.getdoc(thing) or ""
    sections = re.split(r"\n(?:Returns|Attributes)\n-+\n", text.split("Parameters\n----------\n")[1])
    assert len(sections) == 2, f"{name}: expected the sections Parameters and Returns"
    documented = {
        word.strip("* ")
        for line in sections[0].splitlines()
        if line and not line.startswith(" ")
        for word in line.split(" : ")[0].split(",")
    }
    assert documented == set(inspect.signature(thing).parameters) - {"self"}
    assert "Raises\n------\n" in text or "." in name
    types = " ".join(line.split(" : ")[1] for line in sections[0].splitlines() if line[:1].strip() and " : " in line)
    named = set(re.findall(r"\b[A-Z]\w*[a-z]\w*", types))
    assert named <= set(td.__all__) | OUTSIDE, f"{name}: {named - set(td.__all__)} are nowhere to be found"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_calls_a_function(command: str) -> None:
    text = (PACKAGE / "commands" / f"{command.replace('-', '_')}.py").read_text(encoding="utf-8")
    assert set(re.findall(r"\btd\.(\w+)\(", text)) & set(FUNCTIONS)


def test_every_result_says_what_it_is() -> None:
    """A dataclass with a docstring, tables where it has any, pictures, and all of it as files."""
    for name in RESULTS:
        result = getattr(td, name)
        assert dataclasses.is_dataclass(result) and len(result.__doc__ or "") > 60, name
        for method in ("to_pandas", "plot", "report", "lines"):
            assert inspect.getdoc(getattr(result, method)), f"{name}.{method}"


def test_one_list_of_names() -> None:
    """What type checkers see is what there is."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    (block,) = [n for n in tree.body if isinstance(n, ast.If)]
    imports = [n for n in block.body if isinstance(n, ast.ImportFrom) and n.level]
    seen = {alias.name: n.module for n in imports for alias in n.names}
    assert seen == td._HOME
    assert sorted(seen) == td.__all__
    assert set(dir(td)) >= set(seen)


IMPORTS = """
import tubular_dea.identify.fitting.fit, tubular_dea.sweep.plan, tubular_dea.discover.engine
import tubular_dea as td
from tubular_dea.identify.fitting import fit
from tubular_dea.sweep import plan
import tubular_dea.identify.fitting.fit as fit_too, tubular_dea.sweep.plan as plan_too
import tubular_dea.discover.engine as engine
""".strip().splitlines()


@pytest.mark.parametrize("order", [1, -1])
def test_a_name_stays_a_function_whatever_is_imported(order: int) -> None:
    code = """
assert [f.__name__ for f in (td.identify, td.sweep, td.discover)] == ["identify", "sweep", "discover"]
assert [f.__module__ for f in (td.identify, td.sweep)] == ["tubular_dea.api.identify", "tubular_dea.api.sweep"]
assert "Parameters" in td.identify.__doc__
assert fit_too is fit and fit.__name__ == "tubular_dea.identify.fitting.fit"
assert plan_too is plan and plan.__name__ == "tubular_dea.sweep.plan"
assert engine.__name__ == "tubular_dea.discover.engine"
"""
    subprocess.run([sys.executable, "-c", "\n".join(IMPORTS[::order]) + code], check=True, env=_environment())


def test_importing_the_package_imports_nothing_else() -> None:
    code = "import sys; before = set(sys.modules); import tubular_dea; print(sorted(set(sys.modules) - before))"
    said = subprocess.run([sys.executable, "-c", code], check=True, env=_environment(), capture_output=True, text=True)
    heavy = {"numpy", "sympy", "scipy", "matplotlib", "plotly", "fmpy", "pandas", "xarray"}
    assert not heavy & set(ast.literal_eval(said.stdout))
    assert set(ast.literal_eval(said.stdout)) <= {"__future__", "tubular_dea"}, said.stdout


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    run = td.simulate(pressure="95 mmHg", voltage=0, stop=0.1)
    for library in ("pandas", "xarray"):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(ImportError, match=rf"needs {library}.*pip install '\.\[tables\]'"):
            getattr(run, f"to_{library}")()


def test_a_response_and_a_sweep_become_datasets(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    run = td.simulate(pressure="95 mmHg", voltage=0, stop=0.1)
    made = run.to_xarray()
    assert made["lambda_2"].dims == ("time",) and np.array_equal(made["lambda_2"], run["lambda_2"])
    assert made["pressure"].attrs["units"] == "Pa" and np.array_equal(made["time"], run.time)
    plan = {
        "model": "TubularDEA",
        "inputs": {"pressure": "1 kPa", "voltage": "0 V"},
        "run": {"stop": "0.1 s"},
        "vary": {"C_1": {"from": 3e5, "to": 4e5, "count": 3}},
        "outputs": {"end": "final lambda_2"},
    }
    rows = td.sweep(plan, tmp_path / "out")
    assert dict(rows.to_xarray().sizes) == {"C_1": 3}
    assert np.array_equal(rows.to_xarray()["end"], rows["end"])


def test_any_plant_is_simulated_as_the_tube_is(folder: Path) -> None:
    file = "cosim_examples/plants/cascaded_tanks.py"
    by_file = td.simulate(file, pump="step 0 3 V at 10", stop="100 s", interval="1 s")
    by_plant = td.simulate(td.load_plant(file), {"pump": "step 0 3 V at 10"}, stop=100, interval=1)
    assert by_file.time.size == 101
    assert np.array_equal(by_file["level_2"], by_plant["level_2"])
    assert by_file["level_2"][-1] > 2
    assert by_file.units["level_2"] == "V" and next(iter(by_file.units)) == "pump"
    assert "level_2" in by_file and "level" not in by_file


def test_a_step_is_drawn_when_it_happens() -> None:
    """Not as a ramp that begins a sample before it; at a time that is no sample, too."""
    run = td.simulate(pressure=0, voltage="step 0 5 kV at 0.503 until 1", stop=2)
    time, values = run.plot().axes[1].lines[0].get_data()
    assert np.interp([0.5029, 0.9999], time, values) == pytest.approx([0, 5])
    assert values[time == 1.0].tolist() == [5, 0]


def test_a_result_is_what_the_command_writes(folder: Path) -> None:
    drive = {"pressure": "95 mmHg", "voltage": "step 0 5 kV at 1"}
    options = [word for name, text in drive.items() for word in (f"--{name}", text)]
    assert main(["simulate", *options, "--stop", "2", "--set", "C_1=340kPa", "--out", "command"]) == 0
    paths = td.simulate(stop=2, parameters={"C_1": "340 kPa"}, **drive).report("function")
    for path in paths:
        assert path.read_bytes() == Path("command", path.name).read_bytes()


def test_a_tube_in_memory_is_assisted_and_saved_for_commands(folder: Path) -> None:
    lagging = td.tube(["electrode_resistance"], tau_e="30 ms")
    own = td.assist("failing", beats=5, tube=lagging)
    voltage, inside = own.assisted["scheduler.voltage"], own.assisted["tube.electric_field"]
    reached = np.argmax(voltage > 0.99 * voltage.max())
    assert inside[reached] < 0.5 * inside.max()  # at the end of the flank, 30 ms are far from over
    assert td.load(own.loop.model_file_in(folder)) == lagging


def test_a_patient_in_memory_is_one_for_commands(folder: Path) -> None:
    values = td.patient({**td.patient("stiff"), "C": "0.7 mL/mmHg"})
    own = td.assist(values, beats=5)
    assert (
        own.without["heart.aortic_pressure"].max() < td.assist("stiff", beats=5).without["heart.aortic_pressure"].max()
    )
    assert td.patient(own.loop.patient_in(folder)) == values


def test_tables_of_an_assisted_heart(folder: Path) -> None:
    helped = td.assist("failing", beats=6, settings={"scheduler.on_time": "-10 ms"})
    assert helped.loop.model_file_in(folder) == "" and not Path("model.json").exists()  # the paper's needs none
    table = helped.to_pandas()
    work = helped.course.assisted["stroke_work"]
    assert table.loc["stroke_work", "with"] == work.mean and table.loc["stroke_work", "unit"] == "J"
    assert helped.to_dict()["settings"]["scheduler.on_time"] == pytest.approx(-0.01)


def test_recordings_in_memory_keep_their_names_and_geometry() -> None:
    run = td.simulate(pressure="ramp 0 95 mmHg from 0 to 1", voltage="step 0 5 kV at 2", stop=3)
    radius = {"time (s)": run.time, "p [mmHg]": run["pressure"] / 133.322, "U [kV]": run["voltage"] / 1e3}
    radius["radius [mm]"] = 1e3 * run["radius"]
    columns = {"pressure": "p", "voltage": 3}
    data = td.read_recordings({"1e-3": radius, "b.c": radius}, columns=columns, geometry={"r_o": "14.9 mm"})
    assert [e.name for e in data.experiments] == list(data) == ["1e-3", "b.c"]
    assert data["b.c"].outputs["measured_displacement"] == pytest.approx(run["radius"] - 14.9e-3)
    assert data["b.c"].inputs["voltage"].max() == pytest.approx(5000)
    frame = data.to_pandas()
    assert frame.index.names == ["experiment", "time"] and frame.attrs["units"]["voltage"] == "V"


BENCH = ROOT / "cosim_examples" / "data" / "bench"
NAMES = [path.stem for path in BENCH.glob("*.csv")]
MISTAKES = [
    (lambda: td.tube(C_9=1), "parameters C_9=1: TubularDEA has no parameter 'C_9'"),
    (lambda: td.tube(["resistance"]), "there is no effect 'resistance'"),
    (lambda: td.tube(C_1="1 kV"), "expected a unit like 'Pa' but was given 'kV'"),
    (lambda: td.tube(r_o=-1.0), "expected 0.0001 to 10 m but was given -1 m"),
    (lambda: td.load("nothing.json"), "there is no file nothing.json"),
    (lambda: td.load_plant("tupe"), "plant tupe: expected FILE.py"),
    (
        lambda: td.simulate(pressure="95 mmHg", stop=10),
        'voltage is missing: expected a file of inputs, or each of pressure, voltage, as in voltage="step 0 5 kV at 2"',
    ),
    (lambda: td.simulate(presure="95 mmHg", voltage=0), "input presure: TubularDEA has no such input; did you mean"),
    (
        lambda: td.simulate(inputs="no.csv", voltage=0),
        "voltage and inputs exclude each other: these inputs have times of their own; give one of the two",
    ),
    (lambda: td.simulate(pressure=1, voltage=0, interval=0), "interval: expected more than 0"),
    (lambda: td.simulate(pressure=1, voltage=0, tolerance=0), "tolerance: expected 1e-12 to 1e-2"),
    (lambda: td.simulate(pressure=1, voltage=0, stop="3 kV"), "stop: expected a unit like 's'"),
    (lambda: td.simulate(pressure=float("nan"), voltage=0), "pressure"),
    (lambda: td.read_recordings("nowhere"), "nowhere: expected a folder of recordings"),
    (lambda: td.read_recordings({"a": {"time [s]": [0, 1], "pressure [Pa]": [1]}}), "data a: expected columns of one"),
    (lambda: td.read_recordings("nowhere", columns={"radios": 3}), "nowhere"),
    (lambda: td.identify("cosim_examples/data/bench", start="table-3"), "start table-3: TubularDEA has no such"),
    (lambda: td.identify("cosim_examples/data/bench", starts=0), "starts: expected at least 1 but was given 0"),
    (lambda: td.identify("cosim_examples/data/bench", free=["C_7"]), "no tunable parameter 'C_7'"),
    (lambda: td.discover("cosim_examples/data/bench", seed=-1), "seed: expected at least 0 but was given -1"),
    (
        lambda: td.discover(td.read_recordings(BENCH), hold_out=NAMES),
        "hold_out: all experiments are held out; name fewer",
    ),
    (lambda: td.discover("cosim_examples/data/bench", hold_out=["x"]), "hold_out x: there is no experiment 'x'"),
    (lambda: td.assist("fialing"), "no patient 'fialing'; did you mean failing"),
    (lambda: td.assist(voltage="high"), "voltage: expected a number"),
    (lambda: td.assist(voltage="55 kV"), "voltage: expected 0 to 20 kV but was given 55 kV"),
    (lambda: td.assist(voltage=-5000), "voltage: expected 0 to 20 kV but was given -5 kV"),
    (lambda: td.assist(tube="README.md"), "tube README.md: expected a model.json"),
    (lambda: td.assist(beats=2), "beats: expected at least 5"),
    (lambda: td.assist(settings={"hart.C": 1}), "settings hart.C=1: expected PART.PARAMETER=VALUE"),
    (lambda: td.assist(scheme="sor"), "scheme: expected one of jacobi, gauss-seidel, implicit"),
    (lambda: td.assist(step=0), "step: expected a positive number of seconds"),
    (lambda: td.assist(controller="40 mm"), "controller: expected"),
    (lambda: td.assist(tube=td.load_plant("aorta")), "tube: expected a tube (TubularDEA) but it holds AorticAfterload"),
    (lambda: td.compare({}), "cases: expected at least one case"),
    (lambda: td.compare({"a": {"hart.C": 1}}), "cases hart.C=1: expected PART.PARAMETER=VALUE with one of the parts"),
    (lambda: td.best_pulse(objective="speed"), "objective: expected one of"),
    (lambda: td.best_pulse(largest_voltage="much"), "largest_voltage: expected a number"),
    (lambda: td.patient({"C": 1}), "patient"),
    (lambda: td.fit_patient("nothing.csv"), "nothing.csv"),
    (lambda: td.sweep({"outputs": ["radius"]}, workers=0), "workers: expected at least 1 but was given 0"),
    (lambda: td.sweep("nothing.toml"), "nothing.toml"),
    (lambda: td.build_fmu("tube", "t.fmu", platforms="amiga"), "platforms: expected some of host, all"),
    (lambda: td.build_fmu("tube", "t.fmu", fmi=1), "fmi: expected 2 or 3 but was given 1"),
    (lambda: td.build_fmu(td.tube(["pressure_delay"]), "t.fmu", python=True), "python: TubularDEA has pure delays"),
    (
        lambda: td.identify("cosim_examples/data/mock_loop", "cosim_examples/plants/mock_loop.py", staged=True),
        "staged: the plant MockLoop declares no stages",
    ),
    (lambda: td.lab_page("aorta"), "model aorta: expected a model of TubularDEA but it holds AorticAfterload"),
]


@pytest.mark.parametrize(("call", "message"), MISTAKES, ids=[message[:40] for _, message in MISTAKES])
def test_a_mistake_is_a_user_error_that_says_what_to_mend(
    call: Callable[[], object], message: str, folder: Path
) -> None:
    before = sorted(folder.iterdir())
    with pytest.raises(td.UserError) as caught:
        call()
    assert message in str(caught.value)
    assert "--" not in str(caught.value) and "\n" not in str(caught.value)
    assert sorted(folder.iterdir()) == before


def test_the_command_names_the_option_where_python_names_the_argument(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for words, shown in {
        "simulate --pressure 1 --voltage 0 --set C_9=1": "--set C_9=1: TubularDEA has no parameter",
        "assist --beats 2": "--beats: expected at least 5",
        "assist --compare hart.C=1": "--compare hart.C=1: expected PART.PARAMETER=VALUE",
        "assist --model aorta.json": "there is no file aorta.json",
        "identify cosim_examples/data/bench --out out --start table-3": "--start table-3: TubularDEA has no such",
        "simulate --plant tupe --pressure 1 --voltage 0": "--plant tupe: expected FILE.py",
        "close-loop cosim_examples/data/bench --out out --hold-out x": "--hold-out x: there is no experiment 'x'",
    }.items():
        assert main(words.split()) == 2
        assert shown in capsys.readouterr().err


SCRIPT = """\
import tubular_dea as td

tube = td.tube(C_1="340 kPa")
run = td.simulate(tube, pressure="95 mmHg", voltage="step 0 5 kV at 1", stop=3)
displacement: float = run["radial_displacement"].max()
run.plot().savefig("run.png")
found = td.discover(td.read_recordings("bench"))
names: list[str] = [effect.id for effect in found.effects]
fitted: float = td.identify("bench").parameters["C_1"].value
helped: str = td.assist("failing", "5.5 kV", tube=found.model).verdict
columns = list(td.sweep({"model": tube, "outputs": ["radius"]}).units)
td.build_fmu(found.model, "better.fmu")
"""


@pytest.mark.long
def test_a_users_mypy_is_strict_and_content(tmp_path: Path) -> None:
    """With the package among the installed ones, where types count only beside a py.typed: but one line is refused."""
    venv.create(tmp_path / "venv", with_pip=False)
    (installed,) = (tmp_path / "venv").glob("lib/python*/site-packages")
    (installed / "tubular_dea").symlink_to(PACKAGE, target_is_directory=True)
    (installed / "others.pth").write_text(sysconfig.get_path("purelib"))
    interpreter = f"--python-executable={tmp_path / 'venv' / 'bin' / 'python'}"
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", interpreter, "script.py"]
    (tmp_path / "script.py").write_text(SCRIPT + "td.simulate(tube, stop=[1])\n", encoding="utf-8")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=_without_paths())
    assert '"list[int]"; expected' in done.stdout, done.stdout + done.stderr
    assert "Found 1 error in 1 file" in done.stdout, done.stdout


def _without_paths() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "MYPYPATH")}


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}


@pytest.mark.parametrize(
    ("pressure", "voltage"), [("95 mmHg", "step 0 12 kV at 1"), ("ramp 0 180 mmHg from 0 to 2", 0)]
)
def test_a_tube_that_runs_away_is_remarked(pressure: str, voltage: object) -> None:
    run = td.simulate(pressure=pressure, voltage=voltage, stop=2)
    at = run.time[run["snap_through_margin"] < 0][0]
    assert run.remarks == (f"the pressure passes the snap-through fold at {at:.3g} s: the tube runs away there",)
    assert td.simulate(pressure="95 mmHg", voltage="5 kV", stop=1).remarks == ()
