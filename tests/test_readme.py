"""What the README says runs, runs: every command of its blocks, every example; what is excused says why."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import tubular_dea
from blind.score import parsed
from tubular_dea.cli import main
from tubular_dea.kernel import Kernel
from tubular_dea.plants.load import load_plant
from tubular_dea.protocol import Protocol

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PROGRAMS = ("python", "python3", ".venv/bin/python", ".venv/bin/pip", "pip", "pytest", "tubular-dea", "cd")
PLANTS = ("carriage.py", "cell.py", "tube_in_liquid.py")  # the examples of plants, in their order in the README

# What the README says of the answer in a folder: the effects, and what they cannot be told from.
ANSWERS = {
    "named": [("dry_friction(v)", ["hysteresis(v)"])],
    "mock_loop": [("power(outflow)", ["quadratic_resistance(outflow)"]), ("echo(flow)", [])],
}

# Commands whose results other tests look at, too: the first of them carries it out (`carried_out` in conftest.py).
SHARED = (
    "close-loop cosim_examples/data/bench --out",
    "close-loop cosim_examples/data/mock_loop --plant",
    "assist --patient failing --optimise --out",
    "identify cosim_examples/data/bench --out",
)

# Commands that no test here executes, by what they begin with, and why.
EXCUSED = {
    "python3 -m venv": "the environment of these tests was made so",
    ".venv/bin/pip install": "the environment of these tests was made so",
    ".venv/bin/python -m pytest": "this is it: .ci/run executes the README's own line",
    "pip install": "the extras are installed here; that there are such is tested below",
    "python -m blind.score": "hours; tests/test_blind_laboratory.py runs its parts",
    "python -m blind.peers": "hours; tests/benchmarks/test_peers.py runs its parts",
    "python -m measured.table": "minutes, on data not shipped; tests/measured runs the same (two of them on parts)",
    "python tests/benchmarks/": "minutes of a quiet machine",
    "pytest tests/": "tests of this suite, some with more cases than by default",
    "python build_fmu.py --platforms all": "tests/test_package.py builds for all platforms",
    "python cosim_examples/paper_figures.py": "tests/test_paper_figures.py executes it",
}


def blocks() -> list[list[list[str]]]:
    """The README's blocks of shell commands, as lists of words."""
    found = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    return [[shlex.split(part) for line in block.splitlines() for part in _parts(line)] for block in found]


def _parts(line: str) -> list[str]:
    return [part.strip() for part in shlex.join(shlex.split(line, comments=True)).split("'&&'")]


def inline() -> list[list[str]]:
    """The commands in its sentences and tables."""
    text = re.sub(r"```.*?```", "", README, flags=re.DOTALL)
    quoted = [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", text)]
    return [shlex.split(part) for code in quoted if code.split()[0] in PROGRAMS for part in code.split(" && ")]


def excuse(words: list[str]) -> str:
    """Why a command is not executed here; "" for one that is."""
    return next((begin for begin in EXCUSED if " ".join(words).startswith(begin)), "")


def codes() -> list[str]:
    return re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def ran(*words: str, cwd: Path) -> str:
    """What Python prints on `words`."""
    paths = os.pathsep.join(str(ROOT / folder) for folder in ("fmu_src", "tests"))
    done = subprocess.run(
        [sys.executable, *words],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": paths},
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the repository is, with what the README tells its reader to write."""
    for name in ("cosim_examples", "build_fmu.py"):
        (tmp_path / name).symlink_to(ROOT / name)
    plants = [code for code in codes() if "PLANT = " in code]
    for name, code in zip(PLANTS, plants, strict=True):
        (tmp_path / name).write_text(code, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def brought(words: list[str], folder: Path) -> list[str]:
    """The command with what a reader brings in the place of its placeholder."""
    if "DATA" in words and not (folder / "DATA").exists():
        ran("-c", next(code for code in codes() if 'Path("DATA")' in code), cwd=folder)
    return words


def executed() -> Iterator[tuple[int, list[list[str]]]]:
    for number, block in enumerate(blocks()):
        commands = [words for words in block if not excuse(words)]
        if commands:
            yield number, commands


@pytest.mark.long
@pytest.mark.parametrize("number", [number for number, _ in executed()])
def test_block(number: int, folder: Path, carried_out: Callable[..., Path]) -> None:
    """Each command in turn; what --out names is there afterwards."""
    for words in dict(executed())[number]:
        program, *rest = brought(words, folder)
        if program == "tubular-dea" and " ".join(rest).startswith(SHARED):
            *given, option, out = [str(ROOT / w) if w.startswith("cosim_examples/") else w for w in rest]
            assert option == "--out"
            (folder / out).symlink_to(carried_out(*given), target_is_directory=True)
        elif program == "tubular-dea":
            assert main(rest) in (0, None), " ".join(words)
        else:
            assert program in ("python", ".venv/bin/python"), f"expected a program that is known, not {program}"
            assert ran(*rest, cwd=folder)
        if "--out" in rest:
            out = folder / rest[rest.index("--out") + 1]
            if out.name in ANSWERS:
                found = json.loads((out / "result.json").read_text(encoding="utf-8"))
                assert [(e["id"], e["equivalent"]) for e in found["effects"]] == ANSWERS[out.name]
            assert out.is_file() or any(out.iterdir()), f"{' '.join(words)}: nothing in {out.name}"


def test_what_is_excused_is_there() -> None:
    """Every command is executed above, or excused; what it names exists; no excuse is left over."""
    sentences = [words for words in inline() if words[0] not in ("tubular-dea", "cd")]  # tubular-dea: the next test
    unexcused = [" ".join(words) for words in sentences if not excuse(words)]
    assert not unexcused, "neither executed nor excused"
    every = sentences + [words for block in blocks() for words in block]
    assert {excuse(words) for words in every} - {""} == set(EXCUSED)
    options = (ROOT / "tests/conftest.py").read_text(encoding="utf-8")
    for words in filter(excuse, every):
        files = [ROOT / w for w in words if "/" in w and w[0] != "."]
        if words[1:2] == ["-m"] and words[2] not in ("venv", "pytest"):
            files.append(ROOT / "tests" / (words[2].replace(".", "/") + ".py"))
        for file in files:
            assert file.exists(), f"{' '.join(words)}: there is no {file}"
        if words[1:2] == ["-m"] and words[2].startswith("blind."):
            parsed(words[3:])  # which ends the test at an option that there is not
        for option in [w for w in words if w.startswith("--fuzz")]:
            assert f'"{option}"' in options, f"{option} is no option of the tests"
        for extra in re.findall(r"\.\[(\w+)\]", " ".join(words)):
            assert extra in PROJECT["optional-dependencies"]


def test_every_command_and_option_in_the_text_exists(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where it is not run: in sentences, with placeholders."""
    mentioned = re.findall(r"`tubular-dea ([a-z-]+)([^`]*)`", README)
    mentioned += [(words[1], " ".join(words[2:])) for block in blocks() for words in block if words[0] == "tubular-dea"]
    assert {name for name, _ in mentioned} >= {"build", "close-loop", "identify", "simulate", "sweep", "handbook"}
    monkeypatch.setenv("COLUMNS", "200")
    for name in {name for name, _ in mentioned}:
        with pytest.raises(SystemExit):
            main([name, "--help"])
        told = capsys.readouterr().out
        for option in {o for other, rest in mentioned if other == name for o in re.findall(r"--[a-z-]+", rest)}:
            assert re.search(rf"{option}\b", told), f"{name} has no {option}"


@pytest.mark.long
def test_ten_lines(folder: Path) -> None:
    """They say what the comments behind them say (up to ...)."""
    code = codes()[0]
    assert len(code.splitlines()) <= 10
    said = ran("-c", code, cwd=folder).splitlines()
    told = [line.rpartition("  # ")[2] for line in code.splitlines() if line.startswith("print(")]
    for line, expected in zip(said, told, strict=True):
        assert line == expected or line.startswith(expected.removesuffix("...")), expected
    assert (folder / "better.fmu").stat().st_size > 1e4


def test_fmpy(fmi2_fmu: Path, tmp_path: Path) -> None:
    (tmp_path / "build" / "fmi2").mkdir(parents=True)
    shutil.copy(fmi2_fmu, tmp_path / "build" / "fmi2" / "TubularDEA.fmu")
    said = ran("-c", codes()[1], cwd=tmp_path).strip()
    assert f"# {said} (" in codes()[1]


def test_own_plant_and_own_effect(folder: Path) -> None:
    carriage, cell, liquid = PLANTS
    assert "dry_friction(v)" in ran("-m", "tubular_dea.plants", carriage, cwd=folder)
    assert "cubic(bridge)" in ran("-m", "tubular_dea.plants", cell, cwd=folder)
    plant = load_plant(liquid)
    drag = plant.catalogue["fluid_drag"]
    protocol, times = (
        Protocol.of([0, 0.1, 0.1, 0.4], pressure=[12666] * 4, voltage=[0, 0, 5e3, 5e3]),
        np.arange(401) * 1e-3,
    )
    start = {"start_at_equilibrium": 1.0}
    runs = [
        Kernel(model).simulate(protocol, times, start)["radius"]
        for model in (plant.model, drag(plant.model), drag(plant.model).with_values(drag.typical))
    ]
    np.testing.assert_allclose(runs[1], runs[0], rtol=1e-9)
    assert runs[2][105] < runs[0][105] - 1e-5


def test_pictures_and_links_are_there() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
    headings = re.findall(r"^#+ (.*)$", README, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", h.lower()).replace(" ", "-") for h in headings}
    for target in re.findall(r"\]\(#([^)]+)\)", README):
        assert target in anchors, target


def test_laboratories_are_counted_as_their_table_says() -> None:
    """The two rows of the README are the sums of the columns of tests/blind/laboratories.md."""
    tables = (ROOT / "tests" / "blind" / "laboratories.md").read_text(encoding="utf-8").partition("\n## Plants")
    for head, table in (("| of the tube, by ", tables[0]), ("| of other plants, by ", tables[2])):
        sums = []
        rows = [row.split("|")[2:6] for row in table.splitlines() if row.startswith("| ")]
        for column in zip(*rows, strict=True):
            counts = [re.match(r" (?:(\d+) → )?(\d+) of (\d+)", cell) for cell in column]
            before, after, trials = np.sum([[int(c[1] or c[2]), int(c[2]), int(c[3])] for c in counts if c], axis=0)
            sums.append(f"{before} → {after} of {trials}")
        row = next(line for line in README.splitlines() if line.startswith(head))
        assert [cell.strip() for cell in row.split("|")[2:6]] == sums


def test_what_the_commands_write_is_ignored() -> None:
    ignored = (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()
    for words in [words for block in blocks() for words in block if "--out" in words]:
        out = words[words.index("--out") + 1]
        assert f"/{out}" in ignored or f"/{out}/" in ignored, f"{out} is not in .gitignore"


def test_citation_is_of_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {tubular_dea.__version__}\n" in text
    assert f"\nlicense: {PROJECT['license']}\n" in text


def test_measured_pressure_example(fmi2_fmu: Path, tmp_path: Path) -> None:
    """Runs on the data that comes with the project, and on a file of the user's."""
    (tmp_path / "build" / "fmi2").mkdir(parents=True)
    shutil.copy(fmi2_fmu, tmp_path / "build" / "fmi2" / "TubularDEA.fmu")
    time = np.arange(0, 5, 0.01)
    table = np.column_stack([time, 95 + 20 * np.sin(2 * np.pi * 1.2 * time)])
    np.savetxt(tmp_path / "mine.csv", table, "%.5g", ",", header="time [s],pressure [mmHg]", comments="")
    script = ROOT / "cosim_examples" / "measured_pressure.py"
    for arguments, beats in (([], 5), (["mine.csv"], 6)):
        done = subprocess.run(
            [sys.executable, str(script), *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=120
        )
        assert done.stdout.startswith(f"{beats} beats; the wall moves over"), done.stdout + done.stderr
        assert (tmp_path / "measured_pressure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time [s],pressure [mmHg]\n0,95\n5,95\n", "at least two beats"),
        ("time [s],pressure [kV]\n0,95\n5,95\n", "line 1: column 'pressure'"),
        ("#output name: x\ntimestamp,v\nnoon,1\n", "line 1: expected a column 'time [s]'"),
    ],
)
def test_measured_pressure_refuses_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text(text)
    script = ROOT / "cosim_examples" / "measured_pressure.py"
    done = subprocess.run(
        [sys.executable, str(script), "bad.csv"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode != 0
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["bad.csv"]
