"""A user's machine: no room, no home, links to nowhere, somebody else's folders, endless devices, damaged files.

Each ends in one clear line and status 2, or works all the same; never in a traceback.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tubular_dea.cosim.slaves import Slave
from tubular_dea.export import cache
from tubular_dea.export.compile import host, shared_library
from tubular_dea.files import FileError, read_whole, unpack, write_atomically
from tubular_dea.sweep.models import ExternalFmu
from tubular_dea.sweep.unpacked import unpacked

SOURCE = {"one.c": '__attribute__((visibility("default"))) int one(void) { return 1; }\n'}
SIMULATE = ["simulate", "--pressure", "10 mmHg", "--voltage", "1 kV", "--stop", "0.01"]
PLAN = """name = "long"
model = "TubularDEA"
[outputs]
end = "final lambda_2"
[run]
stop = "20"
[inputs]
pressure = "1 kPa"
voltage = "ramp 0 5 kV from 0 to 20"
[vary]
C_1 = { from = 3e5, to = 4e5, count = 300 }
eps_r = { from = 2, to = 3, count = 300 }
"""


def command(*arguments: str, **environment: str | None) -> subprocess.CompletedProcess[str]:
    changed = {k: v for k, v in {**os.environ, **environment}.items() if v is not None}
    run = [sys.executable, "-m", "tubular_dea.cli", *arguments]
    return subprocess.run(run, capture_output=True, text=True, timeout=300, env=changed)


def refused(done: subprocess.CompletedProcess[str], *words: str) -> None:
    """One line on standard error, status 2."""
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert all(word in done.stderr for word in words), done.stderr


# Where results go ------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no /proc here")
def test_full_disk(tmp_path: Path) -> None:
    """Every write below --out fails as on a full disk."""
    code = (
        "import errno, os, sys\n"
        "from tubular_dea.cli import main\n"
        "real = os.fdopen\n"
        "def full(descriptor, *more, **options):\n"
        "    if sys.argv[-1] in os.readlink(f'/proc/self/fd/{descriptor}'):\n"
        "        raise OSError(errno.ENOSPC, 'No space left on device')\n"
        "    return real(descriptor, *more, **options)\n"
        "os.fdopen = full\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *SIMULATE, "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        timeout=300,
    )
    refused(done, "cannot be written: No space left on device", str(tmp_path / "out"))
    assert not [p for p in (tmp_path / "out").rglob("*") if p.is_file()], "nothing half-written"


def test_a_terminal_that_has_only_ascii(tmp_path: Path) -> None:
    """The report of an assisted heart says +-, and a handbook more: a question mark there, no traceback."""
    done = command("assist", "--beats", "5", "--out", str(tmp_path / "out"), PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert (tmp_path / "out" / "report.html").is_file() and "?" in done.stdout


def test_dangling_link(tmp_path: Path) -> None:
    (tmp_path / "out").symlink_to(tmp_path / "nowhere" / "at all")
    refused(command(*SIMULATE, "--out", str(tmp_path / "out")), "is a link to", "which is not there")
    for out in ("out", "out/further"):  # before anything is searched for
        refused(command("close-loop", str(tmp_path), "--out", str(tmp_path / out)), "--out", "which is not there")
    (tmp_path / "book.html").symlink_to(tmp_path / "nowhere.html")
    refused(command("handbook", "--out", str(tmp_path / "book.html")), "--out", "which is not there")
    with pytest.raises(FileError, match="is a link to .*which is not there"):
        write_atomically(tmp_path / "out" / "file", b"x")


@pytest.fixture
def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every file that is opened to be written has no room."""
    real = Path.open

    def opened(path: Path, mode: str = "r", *more: Any, **options: Any) -> Any:
        return real(Path("/dev/full") if "w" in mode else path, mode, *more, **options)

    def written(path: Path, data: bytes) -> None:
        with opened(path, "wb") as file:
            file.write(data)

    monkeypatch.setattr(Path, "open", opened)
    monkeypatch.setattr(Path, "write_bytes", written)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("load", [lambda p: Slave("tube", p), lambda p: unpacked(ExternalFmu(p.name, p.read_bytes()))])
def test_a_full_temporary_disk_is_no_bad_fmu(
    tmp_path: Path, full_disk: None, load: Callable[[Path], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    with zipfile.ZipFile(tmp_path / "good.fmu", "w") as bundle:
        bundle.writestr("modelDescription.xml", "x" * 20000)
    with pytest.raises(FileError, match=f"{tmp_path / 'temporary'}.*: No space left on device$") as refusal:
        load(tmp_path / "good.fmu")
    assert "expected" not in str(refusal.value)
    assert not list((tmp_path / "temporary").iterdir())


# The cache -------------------------------------------------------------------------------------------------------


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", cache.compiler_environment()["ZIG_GLOBAL_CACHE_DIR"])
    monkeypatch.setenv("TUBULAR_DEA_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.mark.parametrize("damage", [b"", b"\x7fELF", None])
def test_a_damaged_library_is_compiled_again(own_cache: Path, damage: bytes | None) -> None:
    good = shared_library(SOURCE, host())
    (library,) = own_cache.glob(f"*{host().suffix}")
    if damage is None:
        library.with_name(library.name + ".sha256").unlink()
    else:
        library.write_bytes(good[: len(good) // 2] + damage)
    assert shared_library(SOURCE, host()) == good
    assert library.read_bytes() == good


def test_no_home(tmp_path: Path) -> None:
    """A number that the system has no user for, and no HOME: the cache, and zig's, in the temporary folder."""
    code = (
        "import os, pwd, sys\n"
        "pwd.getpwuid = lambda n: (_ for _ in ()).throw(KeyError(n))\n"
        "from tubular_dea.cli import main\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    gone = ("HOME", "XDG_CACHE_HOME", "TUBULAR_DEA_CACHE", "ZIG_GLOBAL_CACHE_DIR")
    environment = {k: v for k, v in os.environ.items() if k not in gone} | {"TMPDIR": str(tmp_path)}
    environment["MPLCONFIGDIR"] = str(tmp_path / "matplotlib")
    done = subprocess.run(
        [sys.executable, "-c", code, *SIMULATE, "--out", str(tmp_path / "out")],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    (folder,) = tmp_path.glob("tubular-dea-*")
    assert "there is no home folder; using" in done.stderr
    assert (folder / "zig").is_dir()
    assert list(folder.glob(f"*{host().suffix}"))


@pytest.mark.parametrize("obstacle", ["file", "link"])
def test_a_cache_that_cannot_be_made(
    own_cache: Path, obstacle: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The temporary folder takes its place, and a line says so."""
    own_cache.write_text("") if obstacle == "file" else own_cache.symlink_to(own_cache.parent / "nowhere" / "at all")
    temporary = own_cache.parent / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    shared_library(SOURCE, host())
    assert f"{own_cache} cannot be used as a cache" in capsys.readouterr().err
    assert list(temporary.glob(f"tubular-dea-*/*{host().suffix}"))


def test_a_cache_of_somebody_else_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    me = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: me + 1)
    (tmp_path / "theirs").mkdir()
    if me == 0:
        os.chown(tmp_path / "theirs", 12345, 12345)
    assert cache._unusable(tmp_path / "theirs") == "it belongs to another user"


# What is read ----------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no /dev/zero here")
def test_endless_devices(tmp_path: Path) -> None:
    refused(command("simulate", "--inputs", "/dev/zero", "--out", str(tmp_path / "out")), "/dev/zero", "it is a device")
    refused(command("sweep", "/dev/urandom", "--out", str(tmp_path / "out")), "/dev/urandom", "it is a device")
    for name in ("endless.toml", "endless.json"):
        (tmp_path / name).symlink_to("/dev/zero")
    refused(command("assist", "--patient", str(tmp_path / "endless.toml")), "endless.toml", "it is a device")
    refused(command("build", "--model", str(tmp_path / "endless.json")), "endless.json", "it is a device")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "bench.toml").symlink_to("/dev/zero")
    (tmp_path / "data" / "one.csv").write_text("time [s],pressure [Pa],voltage [V],radius [m]\n0,0,0,0.015\n")
    refused(command("close-loop", str(tmp_path / "data"), "--dry-run"), "bench.toml", "it is a device")


def test_more_than_the_largest_input(tmp_path: Path) -> None:
    (tmp_path / "large").write_bytes(b"x" * 1001)
    assert read_whole(tmp_path / "large", 1001)
    with pytest.raises(FileError, match="expected at most 1e-06 GB"):
        read_whole(tmp_path / "large", 1000)
    with pytest.raises(FileError, match="it is a folder"):
        read_whole(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with subprocess.Popen(["sh", "-c", f"printf abc > '{tmp_path / 'pipe'}'"]):
        assert read_whole(tmp_path / "pipe") == b"abc"


@pytest.mark.parametrize("name", ["0.csv", "bench.toml"])
def test_a_pipe_in_a_folder_is_no_recording(tmp_path: Path, name: str) -> None:
    """Nobody writes to it: reading would wait for ever."""
    (tmp_path / "a.csv").write_text("time [s],pressure [Pa],voltage [V],radius [m]\n0,0,0,0.015\n")
    os.mkfifo(tmp_path / name)
    refused(command("close-loop", str(tmp_path), "--dry-run"), f"{name}: expected a file but it is a pipe; move it")


def bomb(path: Path, megabytes: int) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bundle, bundle.open("zeros", "w") as file:
        for _ in range(megabytes):
            file.write(bytes(1 << 20))
    return path


def test_an_archive_that_unpacks_to_too_much(tmp_path: Path) -> None:
    archive = bomb(tmp_path / "bomb.fmu", 12)
    assert archive.stat().st_size < 20_000
    with pytest.raises(FileError, match="unpacks to more than 0.01 GB"):
        unpack(archive, tmp_path / "unpacked", 10_000_000)
    assert (tmp_path / "unpacked" / "zeros").stat().st_size <= 10_000_000
    unpack(archive, tmp_path / "whole", 13_000_000)
    assert (tmp_path / "whole" / "zeros").stat().st_size == 12 << 20


@pytest.mark.parametrize("name", ["../out", "/etc/out", "a/../../out", "C:/out", "..\\out"])
def test_names_that_lead_out(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as bundle:
        bundle.writestr(name, "x")
    with pytest.raises(FileError, match="leads out of it"):
        unpack(tmp_path / "a.fmu", tmp_path / "inside")
    assert not list(tmp_path.glob("out"))


# Long work -------------------------------------------------------------------------------------------------------


def test_interrupted_in_its_first_seconds_a_sweep_leaves_something(tmp_path: Path) -> None:
    """And says how far it is, though its output is no terminal."""
    (tmp_path / "plan.toml").write_text(PLAN)
    places = [str(tmp_path / "plan.toml"), "--out", str(tmp_path / "out")]
    run = [sys.executable, "-m", "tubular_dea.cli", "sweep", *places]
    heeded = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a shell's background jobs are started deaf to it
    with subprocess.Popen(run, stderr=subprocess.PIPE, text=True, preexec_fn=heeded) as process:  # noqa: PLW1509
        deadline = time.monotonic() + 240
        while time.monotonic() < deadline and not list((tmp_path / "out").glob("parts/*.parquet")):
            assert process.poll() is None, "it ended too soon to be interrupted"
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        words = process.communicate(timeout=120)[1]
    assert process.returncode == 130
    assert "Traceback" not in words
    assert words.strip().endswith("interrupted")
    parts = sorted((tmp_path / "out" / "parts").glob("part-*.parquet"))
    assert parts
    assert parts[0].name == "part-000000000.parquet"


def test_progress_in_lines(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    from tubular_dea import progress

    monkeypatch.setattr(progress, "EVERY", 0.05)
    monkeypatch.setattr(progress, "SILENT", 0.05)
    with progress.progress_bar(total=4, desc="work") as bar:
        for _ in range(4):
            time.sleep(0.06)
            bar.update()
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) >= 2
    assert all(line.startswith("work:") and "\r" not in line for line in lines)
    assert "4/4" in lines[-1]
    with progress.progress_bar(total=4, desc="short") as bar:
        bar.update(4)
    assert capsys.readouterr().err == ""
    with progress.progress_bar(desc="long") as bar:
        bar.update()
        time.sleep(0.3)
        assert capsys.readouterr().err.startswith("long"), "one long step is told while it lasts"
        time.sleep(1.2)  # the time that has gone is told in whole seconds
        assert capsys.readouterr().err.startswith("long"), "and goes on being told"
    assert not bar._clock.is_alive(), "no thread is left behind"


def test_a_full_disk_is_told_with_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiler's own words name no folder that a user knows of."""
    monkeypatch.setenv("TUBULAR_DEA_CACHE", str(tmp_path))
    said = cache.why_compiling_failed("clang -cc1as: fatal error: IO failure on output stream: No space left on device")
    assert str(tmp_path) in said and "set TUBULAR_DEA_CACHE" in said and "clang" not in said
    assert cache.why_compiling_failed("model.c:1: what is this?") == "\nmodel.c:1: what is this?"
