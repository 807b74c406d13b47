"""A plant in a user's file: it loads, it is saved and comes back, and what is wrong with it is said in one line."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import fmpy
import numpy as np
import pyarrow.parquet as pq
import pytest

import tubular_dea as td
from tubular_dea.api.ended import recorded
from tubular_dea.api.given import model_of
from tubular_dea.cli import main
from tubular_dea.discover.engine import discover
from tubular_dea.errors import ArgumentError, UserError
from tubular_dea.kernel import Kernel, KernelError
from tubular_dea.laws import laws
from tubular_dea.model.declare import DeclarationError
from tubular_dea.model.effect import with_effects
from tubular_dea.plants import Build, Input, Output, Plant
from tubular_dea.plants import Path as Place
from tubular_dea.plants.__main__ import main as tables
from tubular_dea.plants.load import PlantError, load_plant
from tubular_dea.plants.saved import ModelFileError, as_json, load
from tubular_dea.protocol import Protocol

EXAMPLES = Path(__file__).parents[1] / "cosim_examples/plants"
HEAD = """from tubular_dea.plants import *
m = Build("Tank", "A tank")
pump = m.input("pump", "V", nominal=5)
k = m.parameter("k", "1/s", 0.05, minimum=0)
level = m.state("level", "V", start="free", nominal=10)
m.derivative(level, k * (pump - level))
m.output("reading", "V", level)
"""
PLANT = 'PLANT = Plant(m.model(), [Input("pump")], [Output("reading")], places=[Path("pump"), Balance("level")])\n'
OWN = """leak = Quantity("leak", "{unit}", "A leak", minimum=0.0, maximum=1.0, nominal=0.1)
def leaking(m): return added(m, "reading", {body})
effect = Effect("leaking", "level", "It leaks", leaking, (leak,), off={{"leak": 0.0}}, typical={{"leak": 0.1}})
PLANT = Plant(m.model(), [Input("pump")], [Output("reading")], own={{"leaking": effect}})
"""

BESIDE = """
    slow = Quantity("slow", "V", "A state of its own", nominal=1.0)
    m = m.extend(states=[State(slow, m["k"] * (m["level"] - slow.symbol), m["k"])])
    """


def written(folder: Path, text: str) -> str:
    path = folder / "tank.py"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize("name", ["cascaded_tanks.py", "cascaded_tanks.py:SQUARE_ROOT", "silverbox.py", "mock_loop.py"])
def test_the_examples_load(name: str) -> None:
    plant = load_plant(str(EXAMPLES / name))
    assert plant.file.startswith(name)
    assert len(plant.catalogue) > 20
    assert len((EXAMPLES / name.partition(":")[0]).read_text().splitlines()) <= 60
    model = with_effects(plant.model, tuple(plant.catalogue), plant.catalogue)
    assert model.effects == tuple(plant.catalogue)


def test_shipped_plants_by_name() -> None:
    assert load_plant("tube").name == "TubularDEA"
    assert load_plant("aorta").free_starts == {"p_C_start": "each"}


def test_a_plant_is_saved_and_comes_back_with_its_effect(tmp_path: Path) -> None:
    plant = load_plant(written(tmp_path, HEAD + PLANT))
    model = plant.catalogue["saturation(pump)"](plant.model).with_values({"k": 0.1, "pump_saturation_range": 3.0})
    file = tmp_path / "model.json"
    file.write_text(as_json(model, plant=plant))
    assert json.loads(file.read_text())["plant"] == "tank.py:PLANT"
    assert load(file, plant) == model
    with pytest.raises(ModelFileError, match="its plant 'Tank' is declared in tank.py:PLANT; give that file as"):
        load(file)
    with pytest.raises(ModelFileError, match=re.escape(f"the plant (--plant {tmp_path / 'tank.py'})")):
        load(file)
    file.write_text(as_json(model))
    with pytest.raises(ModelFileError, match="expected a model of AorticAfterload but found one of 'Tank'"):
        load(file, load_plant("aorta"))
    file.write_text(as_json(load_plant("tube").model))
    with pytest.raises(ArgumentError, match="expected a model of the given plant, Tank, but it holds TubularDEA; "):
        model_of(file, plant)


def test_a_start_value_is_free(tmp_path: Path) -> None:
    """The response to a start value that differs from record to record, beside its exact solution."""
    plant = load_plant(written(tmp_path, HEAD + PLANT))
    assert plant.free_starts == {"level_start": "each"}
    drive, times = Protocol.of([0, 30], pump=[2, 2]), np.linspace(0, 30, 31)
    run = Kernel(plant.model).simulate(drive, times, {"level_start": 7.0}, sensitivities=["level_start", "k"])
    fading = np.exp(-0.05 * times)
    assert run["reading"] == pytest.approx(2 + 5 * fading, abs=1e-5)
    assert run.sensitivities["reading"][:, 0] == pytest.approx(fading, abs=1e-5)
    assert run.sensitivities["reading"][:, 1] == pytest.approx(-5 * times * fading, abs=1e-3)


def test_definitions_have_the_size_of_what_they_are_made_of() -> None:
    m = Build("Sizes")
    u, k = m.input("u", "V", nominal=4.0), m.parameter("k", "1/s", 0.5)
    m.output("y", "V/s", m.define("q", "V/s", -k * u))
    assert m.model().quantity("q").nominal == 2.0 and m.model().quantity("y").nominal == 2.0


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("def f(:\n", 1, "cannot be read as Python"),
        ("\nimport no_such_module\n", 2, "ModuleNotFoundError: No module named 'no_such_module'"),
        (HEAD + "m.define('q', 'V', level * lost)\n", 8, "NameError: name 'lost' is not defined"),
        (HEAD + "m.parameter('k', 'N/m', float('nan'))\n", 8, "parameter 'k': expected a number but was given nan"),
        (HEAD + "PLANT = Plant(m, [], [])\n", 8, "model: expected a model, as m.model(), but was given a Build"),
        (
            HEAD + "import sympy\nm.define('q', 's', sympy.Symbol('time'))\n",
            9,
            "q uses time, which is not declared; the time since the start is a state: t = m.state('t', 's'), m.derivat",
        ),
        (
            HEAD + "import sympy\nm.define('q', 'V', sympy.Symbol('level'))\n",
            9,
            "q uses level, but another symbol of that name than the declared one; use what the declaration of level",
        ),
        (HEAD + "import sympy\nm.define('q', 'V', sympy.Symbol('levl'))\n", 9, "before it; did you mean level?"),
        (
            HEAD + PLANT.replace('"pump")]', '"pump", hold=True)]'),
            8,
            "Input has no argument 'hold'; did you mean held?",
        ),
        (HEAD + "m.input('v', 'V', nominel=1)\n", 8, "Build.input has no argument 'nominel'; did you mean nominal?"),
        (HEAD + "def f(a):\n  pass\nf(b=1)\n", 10, "TypeError: f() got an unexpected keyword argument 'b'"),
        (
            HEAD + PLANT.replace('"pump")]', '"pump", held=True, band_limited=True)]'),
            8,
            "Input('pump'): expected held or band_limited but was given both",
        ),
        (
            HEAD + PLANT.replace('[Input("pump")]', '[Input("pump"), Input("pump", held=True)]'),
            8,
            "Tank: Input('pump') is given twice in inputs; give it once",
        ),
        (
            HEAD + PLANT.replace('[Output("reading")]', '[Output("reading")] * 2'),
            8,
            "Tank: Output('reading') is given twice in outputs; give it once",
        ),
        (
            HEAD + PLANT.replace('Output("reading")', 'Output("reading", multiples={"double": ("radius", 2)})'),
            8,
            "multiples: expected 'double' to be some times one of reading but was given 2 times 'radius'",
        ),
        (HEAD + "m.define('q', 'V', sqrt(level))\n", 8, "'sqrt' is not defined; write `from sympy import sqrt`"),
        (HEAD + "m.define('q', 'V', math.sqrt(level))\n", 8, "functions of quantities are sympy's: write `from sympy"),
        (HEAD + "m.define('q', 'V', level * (level > 3))\n", 8, "a comparison is no number: write step(x)"),
        (HEAD + PLANT.replace('Input("pump")', '"pump"'), 8, "inputs: expected Input, as Input('pump'), but was given"),
        (HEAD.replace('"Tank", ', '"2 EMPS/../x", '), 2, "Build: expected a name of letters, digits and _ that begins"),
        (HEAD + "m.parameter('_k', '1/s', 1)\n", 8, "begins with a letter but was given '_k'"),
        (HEAD + "m.parameter('k', '1/s', 1)\n", 8, "'k' is declared already, in tank.py, line 4"),
        (HEAD + "m.parameter('c', 'furlong', 1)\n", 8, "'c': cannot read the unit 'furlong'"),
        (HEAD + "m.parameter('c', 'K', 1, display_unit='degC')\n", 8, "'c': display_unit: 'degC' and 'K' have zeros"),
        (HEAD + "m.parameter('c', 'm', 1, display_unit='mmHg')\n", 8, "display_unit: expected a unit like 'm'"),
        (
            HEAD + "m.parameter('c', '1/s', -1, minimum=0)\n",
            8,
            "parameter 'c': expected at least 0 1/s but was given -1; correct the value",
        ),
        (HEAD + "m.parameter('gain', '1', 'two')\n", 8, "parameter 'gain': expected a number but was given 'two'"),
        (HEAD + "from tubular_dea.plants import Balanse\n", 8, "did you mean Balance?"),
        (HEAD + PLANT.replace("Plant(", "Plnt("), 8, "NameError: name 'Plnt' is not defined; did you mean Plant?"),
        (
            HEAD + PLANT.replace('[Path("pump"),', '[Path("pump"), Path("pump"),'),
            8,
            "Path('pump') is given twice in places; give it once",
        ),
        (
            HEAD + "import pathlib\n" + PLANT.replace('[Path("pump"),', '[pathlib.PurePosixPath("pump"),'),
            9,
            "places: expected Path, Balance or Coefficient of tubular_dea.plants but was given PurePosixPath('pump')",
        ),
        (HEAD + "m.input('v', 'V', nominal=0)\n", 8, "nominal: expected a usual size above 0 but was given 0"),
        (HEAD + "m.state('h', 'V', start='fre')\n", 8, "expected a number, an expression, 'free' or 'shared' but was"),
        (HEAD + "m.derivative(k, level)\n", 8, "there is no such state; there are level"),
        (HEAD + "m.derivative(level, pump)\n", 8, "the derivative of 'level' is given twice"),
        (HEAD + "m.state('h', 'V')\nm.model()\n", 8, "the state 'h' has no derivative; add m.derivative(h, ...)"),
        (
            HEAD + "m.define('q', 'V', level if level > 3 else pump)\n",
            8,
            "level > 3 is not known while the file is read: write step(level), positive_part(level) or sympy.Piecewise",
        ),
        (HEAD + "import numpy\nm.define('q', '1', numpy.tanh(k))\n", 9, "NumPy's tanh is for numbers, and this is a"),
        (
            HEAD + "import math\nm.define('q', '1', math.tanh(k))\n",
            9,
            "in m.define('q', '1', math.tanh(k)): a function of",
        ),
        (
            HEAD + "m.define('q', 'V', level > 3)\n",
            8,
            "q: expected a number or an expression but was given level > 3; a",
        ),
        (
            HEAD + "import sympy\nm.define('q', '1', sympy.sign(level))\n",
            9,
            "q: sign(level) cannot be computed with its",
        ),
        (
            HEAD + "m.define('q', 'V', float('nan') * level)\n",
            8,
            "q: expected a finite real expression but was given nan",
        ),
        (
            HEAD + "z = m.parameter('z', 's', 0.0)\nm.define('q', 'V/s', level / (2 * z))\n",
            9,
            "q divides by z, which is 0 with z = 0; declare another value",
        ),
        (
            HEAD.replace('"1/s", 0.05', '"1/s", 0.0') + "m.define('q', 'V.s', level * k**-0.5)\n",
            8,
            "q divides by k, which is 0 with k = 0",
        ),
        (HEAD + "m.define('q', 'V', 'level)')\n", 8, "q: expected an expression but was given 'level)'"),
        (HEAD + "m.define('q', 'V', [level])\n", 8, "q: expected a number or an expression but was given [level]"),
        (HEAD + "m.define('pump_rate', 'V/s', level)\n", 8, "'pump_rate' already means the rate of an input"),
        (HEAD + PLANT.replace('Path("pump")', 'Path("pomp")'), 8, "Path('pomp'): expected an input, or an output that"),
        (
            HEAD + PLANT.replace('Balance("level")', 'Balance("k")'),
            8,
            "expected a state but was given 'k', a parameter",
        ),
        (HEAD + PLANT.replace('Input("pump")', 'Input("pum")'), 8, "Tank has no such input; did you mean pump?"),
        (HEAD + PLANT.replace('Output("reading")', 'Output("level_2")'), 8, "Tank puts out no such quantity"),
        (
            HEAD + PLANT.replace('[Input("pump")]', 'Input("pump")'),
            8,
            "Tank: inputs: expected a list, as inputs=[...], but was given Input(",
        ),
        ("\0", None, "cannot be read as Python"),
        (HEAD, None, "expected a value PLANT = Plant(...) but there is none"),
        (HEAD + PLANT.replace("PLANT", "TANK"), None, "the file has TANK: write tank.py:TANK"),
        (
            "from sympy import sqrt\n"
            + HEAD.replace("pump - level", "pump * sqrt(level**2) / level - level").replace('start="free"', "start=0")
            + PLANT,
            None,
            "d(level)/dt has no value at the start of Tank, whatever the inputs",
        ),
        (HEAD + "PLANT = m.model()\n", None, "expected PLANT to be a Plant but it is of type Model"),
        (HEAD + "raise SystemExit(3)\n", 8, "SystemExit: 3"),
        (
            HEAD.replace("pump - level", "-level") + PLANT,
            8,
            "Path('pump'): no equation uses this input, so nothing can act on its way; leave the place out",
        ),
        (HEAD + OWN.format(unit="1/s", body="k * m['lost']"), 9, "Tank has no quantity 'lost'"),
        (HEAD + OWN.format(unit="1", body="0 * m['leak']"), None, "the parameter 'leak' is in no equation of Tank"),
        (HEAD + OWN.format(unit="m", body="m['leak']"), None, "the effect leaking: reading: "),
        (
            HEAD + OWN.format(unit="1", body="m['leak'] * slow.symbol").replace("return", BESIDE + "return"),
            None,
            "the effect leaking: the start of slow: expected V but k is in 1/s",
        ),
        (  # as something else in the plant already is
            HEAD
            + OWN.format(unit="1", body="m['leak'] * slow.symbol").replace(
                "return", BESIDE.replace('m["k"])])', 'm["k"] * (m["pump"] - m["level"]))])') + "return"
            ),
            None,
            "the effect leaking: the start of slow: expected V but k*(-level + pump) is in V/s",
        ),
        (
            HEAD + OWN.format(unit="1", body="m['leak'] * m['level']").replace('"leak": 0.0', '"leak": 1.0'),
            None,
            "with leak = 1 it changes reading; expected values of `off`",
        ),
        (
            HEAD + OWN.format(unit="m", body="m['leak']").replace('"level", "It', '"levle", "It'),
            None,
            "the effect leaking: channel: 'levle' is no other's; did you mean level?",
        ),
        (
            HEAD + OWN.format(unit="1", body="m['leak']").replace('typical={"leak": 0.1}', 'typical={"leak": 3.0}'),
            10,
            "leaking: typical: leak: expected 0 to 1, the parameter's bounds, but was given 3",
        ),
        (HEAD + PLANT.replace("places", "own={'leaking': 3}, places"), None, "own['leaking']: expected an Effect but"),
        (HEAD + PLANT.replace("places", "own=[3], places"), None, "own: expected {id: Effect} but was given [3]"),
    ],
)
def test_what_is_wrong_with_a_plant_file_is_said_in_one_line(text: str, line: int | None, words: str, tmp_path) -> None:
    name = written(tmp_path, text)
    with pytest.raises(PlantError) as problem:
        load_plant(name)
    said = str(problem.value)
    assert words in said and "\n" not in said
    assert said.startswith(f"{name}, line {line}: " if line else f"{name}: ")


@pytest.mark.parametrize("name", ["../../../n/evil", "", "Tank\n", "Ta\u00f1k", "a.b", "3"])
def test_a_name_that_no_file_could_have_is_refused_wherever_it_comes_from(name: str, tmp_path: Path) -> None:
    plant = load_plant(written(tmp_path, HEAD + PLANT))
    with pytest.raises(DeclarationError, match=r"the model: expected a name of letters, digits and _ that begins with"):
        replace(plant.model, name=name)
    with pytest.raises(DeclarationError, match=r"test_plant_files.py, line \d+: Build: expected a name of letters"):
        Build(name)
    renamed = HEAD + PLANT.replace('Path("pump")', f'Path("pump", names={{"offset": {name!r}}})')
    with pytest.raises(PlantError, match=r"line 8: Path\('pump'\): expected a name of letters, digits and _ that"):
        load_plant(written(tmp_path, renamed))


def test_nothing_may_be_missing_in_a_plant_without_places(tmp_path: Path) -> None:
    bare = load_plant(written(tmp_path, HEAD + PLANT.replace(', places=[Path("pump"), Balance("level")]', "")))
    with pytest.raises(UserError, match=r"Tank: nothing may be missing, as it has no places: expected places="):
        discover(SimpleNamespace(plant=bare))


def test_the_time_since_the_start_is_a_state(tmp_path: Path) -> None:
    clock = 't = m.state("t", "s")\nm.derivative(t, 1)\nm.output("ageing", "V.s", level * t)\n'
    plant = load_plant(written(tmp_path, HEAD + clock + PLANT))
    run = Kernel(plant.model).simulate(Protocol.of([5, 8], pump=[2, 2]), np.array([5.0, 8.0]))
    assert run["ageing"][-1] == pytest.approx(3 * run["reading"][-1], rel=1e-4)


@pytest.mark.parametrize("name", ["nothing.py", "tupe", "tank.txt"])
def test_no_such_plant(name: str) -> None:
    with pytest.raises(PlantError, match=rf"plant {name}: "):
        load_plant(name)


def test_a_model_whose_starts_use_one_another_is_refused() -> None:
    m = Build("Ring")
    a = m.state("a", "1", start=1.0)
    b = m.state("b", "1", start=2 * a)
    k = m.parameter("k", "1/s", 1.0)
    m.derivative(a, k * b)
    m.derivative(b, k * a)
    m.output("y", "1", a)
    model = m.model()
    first, second = model.states
    with pytest.raises(DeclarationError, match="the starts of a, b use one another"):
        type(model)(**{**model.__dict__, "states": (type(first)(first.quantity, first.derivative, b), second)})


def test_the_plant_of_the_readme_loads(tmp_path: Path) -> None:
    text = (EXAMPLES.parents[1] / "README.md").read_text(encoding="utf-8")
    block = next(b for b in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "PLANT" in b)
    plant = load_plant(written(tmp_path, block))
    assert plant.headers() == "time [s],drive [V],position [m]"
    expected = {"dry_friction(v)", "cubic(v)", "softening(spring)", "delay(drive)", "saturation(position)"}
    assert expected <= set(plant.catalogue)


def test_the_index_of_laws_and_a_catalogue_are_printed(capsys) -> None:
    assert tables([]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 2 + len(laws())
    assert tables([str(EXAMPLES / "silverbox.py")]) == 0
    assert "| cubic(velocity) | velocity | velocity_cubic" in capsys.readouterr().out
    assert tables([str(EXAMPLES / "cascaded_tanks.py")]) == 0
    assert "| orifice | outflow_1, outflow_2 | a definition that an input moves, " in capsys.readouterr().out
    assert tables(["nothing.py"]) == 1
    assert capsys.readouterr().err == "error: plant nothing.py: there is no file nothing.py\n"


def test_tables_that_are_interrupted_end_in_a_word(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def interrupted() -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr("tubular_dea.plants.__main__.index", interrupted)
    assert tables([]) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_a_plant_without_places_is_told_to_have_nothing_to_look_for(tmp_path: Path, capsys) -> None:
    bare = PLANT.replace(', places=[Path("pump"), Balance("level")]', "")
    assert tables([written(tmp_path, HEAD + bare)]) == 0
    assert capsys.readouterr().out.startswith("nothing to look for: Tank declares no places; give Plant(..., places=")


def test_a_plant_is_simulated_built_and_swept_by_the_command(tmp_path: Path, capsys) -> None:
    plant = written(tmp_path, HEAD + PLANT)
    assert (
        main(
            [
                "simulate",
                "--plant",
                plant,
                "--input",
                "pump=3 V",
                "--set",
                "level_start=7",
                "--stop",
                "20",
                "--out",
                str(tmp_path / "run"),
            ]
        )
        == 0
    )
    said = capsys.readouterr()
    assert "reading from 4.472 to 7 V" in said.out and not said.err  # 3 + 4 / e
    assert main(["simulate", "--plant", plant, "--input", "pump=3 V", "--out", str(tmp_path / "run")]) == 0
    assert "warning: level_start = 5 V: the plant leaves the start free" in capsys.readouterr().err
    assert main(["build", "--plant", plant, "--out", str(tmp_path / "built")]) == 0
    fmu = tmp_path / "built/fmi2/Tank.fmu"
    found = fmpy.simulate_fmu(str(fmu), stop_time=20, start_values={"pump": 3.0, "level_start": 7.0})
    assert found["reading"][-1] == pytest.approx(3 + 4 * np.exp(-1), abs=1e-4)
    plan = (
        'model = "tank.py"\nstudy = "trajectory"\neffects = ["saturation(pump)"]\noutputs = ["final reading"]\n'
        '[run]\nstop = "20 s"\n[inputs]\npump = "3 V"\n[set]\npump_saturation_share = 1\n'
        '[vary]\npump_saturation_range = ["2 V", "9 V"]\n'
    )
    (tmp_path / "plan.toml").write_text(plan)
    assert main(["sweep", str(tmp_path / "plan.toml"), "--out", str(tmp_path / "swept")]) == 0
    rows = pq.read_table(next((tmp_path / "swept/parts").rglob("*.parquet"))).to_pydict()["final_reading"]
    assert rows == pytest.approx([2 + 3 * np.exp(-1), 3 + 2 * np.exp(-1)], abs=1e-4)
    assert main(["simulate", "--plant", plant, "--input", "pomp=3 V", "--out", str(tmp_path / "none")]) == 2
    assert "--input pomp: Tank has no such input; did you mean pump?" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_a_model_that_cannot_follow_its_records_is_said_with_its_file(tmp_path: Path) -> None:
    plant = load_plant(written(tmp_path, HEAD + PLANT))
    words = "^tank.py:PLANT: the model cannot follow a recorded experiment: it ended; look"
    with pytest.raises(KernelError, match=words), recorded(plant):
        raise KernelError("it ended")


def test_a_plant_that_runs_away_is_said_without_a_warning() -> None:
    m = Build("Levitated", "A body that nothing holds")
    pull = m.input("pull", "m/s", nominal=1.0)
    x = m.state("x", "m", start=0.0, nominal=0.01)
    m.derivative(x, m.parameter("rate", "1/s", 40.0) * x + pull)
    m.output("place", "m", 1.0 * x)
    plant = Plant(m.model(), inputs=[Input("pull")], outputs=[Output("place")], places=[Place("pull")])
    time = 0.01 * np.arange(1000)
    random, tables = np.random.default_rng(0), {}
    for i in range(2):
        pull = 0.1 * np.sin((1 + i) * time)
        read = 0.01 * np.sin(time) + 1e-4 * random.standard_normal(time.size)
        tables[f"file {i}"] = {"time [s]": time, "pull [m/s]": pull, "place [m]": read}
    recordings = td.read_recordings(tables, plant=plant)
    (said,) = recordings.findings()
    assert said.endswith("At its declared values Levitated runs away under these inputs")
    with pytest.raises(UserError, match="runs away by itself"):
        td.discover(recordings)


def test_the_plant_whose_model_is_simulated_says_how_its_recorded_inputs_go_on(tmp_path: Path, capsys) -> None:
    """With --model FILE.py the tube was asked: a KeyError for its pressure."""
    file, record = (
        written(tmp_path, HEAD + PLANT.replace('Input("pump")', 'Input("pump", held=True)')),
        tmp_path / "r.csv",
    )
    record.write_text("time [s],pump [V]\n" + "".join(f"{t},{5 * (t > 10)}\n" for t in range(30)))
    assert main(["simulate", "--model", file, "--inputs", str(record), "--out", str(tmp_path / "out")]) == 0
    assert "pump held until the next row" in capsys.readouterr().out


def test_equations_without_a_value_are_said_with_when(tmp_path: Path) -> None:
    """The root of a falling level below nothing: it was said that the model cannot be solved, and no more."""
    time, one = 0.1 * np.arange(300), 'one = m.parameter("one", "V", 1.0, tunable=False)\n'
    root = HEAD.replace("k * (pump - level)", "k * one * sqrt((pump - level) / one)")
    root = "from sympy import sqrt\n" + root.replace("m.derivative", f"{one}m.derivative")
    table = {"time [s]": time, "pump [V]": np.sin(time), "reading [V]": 5 + np.cos(time)}
    with pytest.raises(UserError, match=r"\(the trajectory ended at 0 s: no step size.* with what keeps them real"):
        td.identify({"one": table}, plant=written(tmp_path, root + PLANT))
