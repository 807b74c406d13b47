"""A command that is killed while it writes leaves every file as it was, or whole and new.

Each command first fills a folder; then it runs again with other settings and kills itself with SIGKILL at a file
operation below that folder, drawn at random from all it makes. Few kills by default, more by
`pytest tests/fuzz/test_kills.py --fuzz-kills 200`. `close-loop`, which takes minutes, is held by the rule that whatever
the package writes goes through `files.write_atomically`, which is killed in the middle of long writes, too.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tubular_dea.model.dea import tubular_dea
from tubular_dea.plants.saved import as_json

SOURCES = Path(__file__).parents[2]
BENCH = SOURCES / "cosim_examples" / "data" / "bench"

SERVER = """
import importlib, json, os, signal, sys, traceback

def carried_out(below, at, arguments, told):
    count = 0

    def watch(event, arguments):
        nonlocal count
        if event.split(".")[0] in ("open", "os", "shutil") and any(str(a).startswith(below) for a in arguments[:2]):
            count += 1
            if count == at:
                os.kill(os.getpid(), signal.SIGKILL)

    from tubular_dea.cli import main
    sys.addaudithook(watch)
    code = main(arguments)
    with open(told, "w") as file:
        json.dump({"operations": count, "modules": list(sys.modules)}, file)
    return code

for line in sys.stdin:
    *given, told = json.loads(line)
    child = os.fork()
    if not child:
        said = os.open(told + ".said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1), os.dup2(said, 2)
        try:
            code = carried_out(*given, told)
        except BaseException:
            traceback.print_exc()
            code = 1
        sys.stderr.flush()
        os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    for name in json.load(open(told))["modules"] if code == 0 else ():
        try:
            importlib.import_module(name)
        except ImportError:
            pass  # made by another module
    print(code, flush=True)
"""

SWEEP = """name = "kills"
model = "TubularDEA"
[outputs]
end = "final lambda_2"
[run]
stop = "0.01"
[inputs]
pressure = "1 kPa"
voltage = "1 kV"
[vary]
C_1 = {{ from = 3e5, to = {to}, count = 6 }}
eps_r = {{ from = 2, to = 3, count = 6 }}
"""
SIMULATE = ["simulate", "--pressure", "95 mmHg", "--stop", "0.1", "--voltage"]
ASSIST = ["assist", "--beats", "5", "--step", "0.005", "--voltage"]


def commands(name: str, folder: Path) -> tuple[list[str], list[str]]:
    """Two ways to call a command that write the same files with other contents."""
    if name == "build":
        for file, values in {"old": {"C_1": 3e5}, "new": {"C_1": 3.1e5}}.items():
            (folder / f"{file}.json").write_text(as_json(tubular_dea().with_values(values), file))
        return tuple(["build", "--model", str(folder / f"{file}.json")] for file in ("old", "new"))
    if name == "identify":
        few = folder / "few"
        few.mkdir()
        for file in ("bench.toml", "04_ramp_7kV.csv", "08_heartbeat_5kV.csv"):
            shutil.copy(BENCH / file, few)
        return tuple(["identify", str(few), "--starts", "1", "--free", free] for free in ("C_1", "eta_o"))
    start = {"simulate": SIMULATE, "assist": ASSIST}[name]
    return [*start, "4 kV"], [*start, "5 kV"]


class Calls:
    """Commands, each in a process of its own: a fork of one that has imported what those before it imported.

    Imports take longer than most of these commands.
    """

    def __init__(self, folder: Path) -> None:
        self.told = folder / "told.json"
        command = [sys.executable, "-c", SERVER]
        self.server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __call__(self, arguments: list[str], out: Path, at: int = 0) -> tuple[int, int]:
        """Exit code (negative: the signal), and how many file operations there were below `out`."""
        assert self.server.stdin and self.server.stdout
        self.told.unlink(missing_ok=True)
        given = [str(out), at, [*arguments, "--out", str(out)], str(self.told)]
        self.server.stdin.write(json.dumps(given) + "\n")
        self.server.stdin.flush()
        code = int(self.server.stdout.readline())
        assert code in (0, -signal.SIGKILL), self.told.with_suffix(".json.said").read_text()
        return code, json.loads(self.told.read_text())["operations"] if code == 0 else 0


@pytest.fixture(scope="module")
def call(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Calls]:
    """Carries out commands."""
    calls = Calls(tmp_path_factory.mktemp("calls"))
    yield calls
    calls.server.communicate()


def contents(folder: Path) -> dict[str, bytes]:
    """Files by name, but for what a killed process has left hidden."""
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and not p.name.endswith(".unfinished")
    }


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX's")
@pytest.mark.parametrize("name", ["build", "simulate", "assist", "identify"])
def test_files_are_old_or_new(
    name: str, call: Calls, tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = commands(name, tmp_path)
    out, kept = tmp_path / "out", tmp_path / "kept"
    assert call(first, out)[0] == 0
    old = contents(out)
    out.rename(kept)
    shutil.copytree(kept, out)
    code, operations = call(second, out)
    new = contents(out)
    assert code == 0 and set(new) == set(old) and operations > 2 * len(new), operations
    changed = [file for file in new if new[file] != old[file]]
    assert changed, "the other settings changed nothing"
    chance = random.Random(request.config.getoption("--fuzz-seed"))
    kills = request.config.getoption("--fuzz-kills")
    for at in [chance.randint(1, operations) for _ in range(kills)]:
        shutil.rmtree(out)
        shutil.copytree(kept, out)
        assert call(second, out, at)[0] == -signal.SIGKILL
        for file, content in contents(out).items():
            assert content in (old.get(file), new.get(file)), f"{file} is torn after a kill at operation {at}"
        assert set(old) <= set(contents(out)), f"files are lost after a kill at operation {at}"
    with capsys.disabled():
        print(f"\n{name}: {kills} kills among {operations} file operations, {len(changed)} files old or new", end="")


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX's")
def test_a_killed_sweep_goes_on_wherever_it_was(
    call: Calls, tmp_path: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyarrow")
    pytest.importorskip("zarr")
    plan = tmp_path / "plan.toml"
    plan.write_text(SWEEP.format(to=4e5))
    arguments = ["sweep", str(plan), "--workers", "1", "--cube"]
    whole, out = tmp_path / "whole", tmp_path / "out"
    code, operations = call(arguments, whole)
    expected = contents(whole)
    assert code == 0 and any("cube.zarr/" in file for file in expected)
    chance = random.Random(request.config.getoption("--fuzz-seed"))
    kills = request.config.getoption("--fuzz-kills")
    for at in [*range(1, 5), *(chance.randint(5, operations) for _ in range(kills))]:
        shutil.rmtree(out, ignore_errors=True)
        assert call(arguments, out, at)[0] == -signal.SIGKILL
        for file, content in contents(out).items():
            assert content == expected.get(file) or "cube.zarr.new" in file, f"{file} is torn, killed at operation {at}"
        assert call(arguments, out)[0] == 0, f"does not go on after a kill at operation {at}"
        assert contents(out) == expected
    with capsys.disabled():
        print(f"\nsweep: {4 + kills} kills among {operations} file operations, all went on", end="")


WRITER = """
import sys
from pathlib import Path
from tubular_dea.files import write_atomically
print("ready", flush=True)
k = 0
while True:
    k += 1
    write_atomically(Path(sys.argv[1]), bytes([k % 256]) * 5_000_000)
"""


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX's")
def test_long_writes_are_whole(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    path, seen = tmp_path / "file", set()
    chance = random.Random(request.config.getoption("--fuzz-seed"))
    path.write_bytes(b"\0" * 5_000_000)
    for _ in range(5 + request.config.getoption("--fuzz-kills")):
        with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE) as writer:
            assert writer.stdout
            writer.stdout.readline()
            time.sleep(chance.uniform(0.0, 0.1))
            writer.kill()
        content = path.read_bytes()
        assert len(content) == 5_000_000 and len(set(content)) == 1
        seen.add(content[0])
        for left in tmp_path.glob(".file.*.unfinished"):
            left.unlink()
    assert len(seen) > 1, "no write came through"


WRITERS = {"write_text", "write_bytes", "fdopen", "to_zarr", "to_csv", "tofile", "write_html", "write_image"}


def test_nothing_writes_past_write_atomically() -> None:
    """But for folders that are temporary (compile.py, external.py, wasm.py, wasm_runtime.py), the cube, whose folder is
    renamed, and the compiled library that only developers write again."""
    import ast

    import tubular_dea

    package = Path(tubular_dea.__file__).parent
    found = set()
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in WRITERS:
                found.add((path.relative_to(package).as_posix(), name))
            modes = [a.value for a in (*node.args, *(k.value for k in node.keywords)) if isinstance(a, ast.Constant)]
            if name == "open" and any(isinstance(m, str) and set(m) & set("wax+") and len(m) < 4 for m in modes):
                found.add((path.relative_to(package).as_posix(), name))
    assert found == {
        ("files.py", "fdopen"),
        ("export/compile.py", "write_text"),
        ("sweep/unpacked.py", "write_bytes"),
        ("files.py", "open"),
        ("export/wasm.py", "write_text"),
        ("export/wasm.py", "write_bytes"),
        ("export/wasm_runtime.py", "write_text"),
        ("export/wasm_runtime.py", "write_bytes"),
        ("sweep/store.py", "to_zarr"),
    }
