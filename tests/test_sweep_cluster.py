"""The same plan on a Dask cluster of real worker processes: the same bytes, with a worker killed on the way, too."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from sweeps import parts, steps
from tubular_dea.cli import main
from tubular_dea.sweep.backends import BackendError, Cluster, Threads, backend
from tubular_dea.sweep.run import carry_out
from tubular_dea.sweep.store import Store

dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")

PLAN = steps(points=2048, outputs=["final lambda_2", "max electric_field", "time of snap", "mean radius"])


@pytest.fixture(scope="module")
def client() -> Iterator[object]:
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("threads") / "out"
    carry_out(PLAN, folder, Threads(1))
    return parts(folder)


def test_cluster_gives_the_same_bytes(client: object, expected: dict[str, bytes], tmp_path: Path) -> None:
    carry_out(PLAN, tmp_path / "out", Cluster(client))
    assert parts(tmp_path / "out") == expected


def test_a_killed_worker_costs_nothing(client: distributed.Client, expected: dict[str, bytes], tmp_path: Path) -> None:
    store = Store.open(tmp_path / "out", PLAN)
    written: list[int] = []
    before = set(client.run(os.getpid).values())
    for part in Cluster(client).run(PLAN, store.missing()):
        store.write(part)
        written.append(part.start)
        if len(written) == 3:
            os.kill(min(before), signal.SIGKILL)
    client.wait_for_workers(2, timeout=30)
    assert set(client.run(os.getpid).values()) != before, "the killed worker was replaced"
    assert sorted(written) == [start for start, _ in store.ranges], "nothing is lost, and nothing comes twice"
    assert parts(tmp_path / "out") == expected


def test_a_running_scheduler_is_used(client: distributed.Client, tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text('study = "rest"\noutputs = ["radius"]\n[vary]\nvoltage = ["0 kV", "5 kV"]\n', encoding="utf-8")
    address = client.scheduler.address
    assert main(["sweep", str(plan), "--out", str(tmp_path / "out"), "--scheduler", address, "--no-report"]) == 0
    assert Store.read(tmp_path / "out").column("radius")[1] > Store.read(tmp_path / "out").column("radius")[0]


def test_no_scheduler_leaves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An address that Dask refuses at once. A folder of a sweep that was interrupted stays as it was."""
    plan, out = tmp_path / "plan.toml", tmp_path / "out"
    plan.write_text('study = "rest"\noutputs = ["radius"]\n[vary]\nvoltage = ["0 kV", "5 kV"]\n', encoding="utf-8")
    words, scheduler = ["sweep", str(plan), "--out", str(out), "--no-report"], dask.config.get("scheduler", None)
    assert main([*words, "--scheduler", "nowhere://127.0.0.1:1"]) == 2
    assert "no Dask scheduler answers at 'nowhere://127.0.0.1:1'" in capsys.readouterr().err
    assert not out.exists() and dask.config.get("scheduler", None) == scheduler
    assert main(words) == 0
    before = {path: path.stat().st_mtime_ns for path in (out, *out.rglob("*"))}
    assert main([*words, "--scheduler", "nowhere://127.0.0.1:1"]) == 2
    assert {path: path.stat().st_mtime_ns for path in (out, *out.rglob("*"))} == before


def test_no_scheduler_there() -> None:
    with (
        pytest.raises(BackendError, match="no Dask scheduler answers at"),
        backend(None, None, "tcp://127.0.0.1:1", timeout=1.0),
    ):
        pass


def test_a_web_server_is_no_scheduler() -> None:
    """A client of Dask waited for it for ever, or took what it said for the length of a message."""
    with ThreadingHTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        address = f"127.0.0.1:{server.server_port}"
        with pytest.raises(BackendError, match="answers at"), backend(None, None, address, timeout=1.0):
            pass
        server.shutdown()


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="this system has no signal masks")
def test_ctrl_c_in_a_terminal_is_one_line(tmp_path: Path) -> None:
    """A terminal sends it to the workers, too: each printed where it was, 70 lines in all."""
    run = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    run += "from tubular_dea.cli import main\nsys.exit(main(sys.argv[1:]))"
    command = [
        "sweep",
        str(Path(__file__).parents[1] / "cosim_examples" / "sweep_snap_through.toml"),
        "--out",
        str(tmp_path / "out"),
    ]
    with subprocess.Popen(
        [sys.executable, "-c", run, *command, "--local-cluster", "2"], stderr=subprocess.PIPE, start_new_session=True
    ) as begun:
        time.sleep(2.0)
        os.killpg(begun.pid, signal.SIGINT)
        _, said = begun.communicate(timeout=60)
    lines = [line for line in said.decode().splitlines() if "rows" not in line]
    assert begun.returncode == 130 and lines == ["tubular-dea sweep: interrupted"]
