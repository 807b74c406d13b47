"""The same plan on a Dask cluster of real worker processes: the same bytes, with a worker killed on the way, too."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

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
    assert "the scheduler nowhere://127.0.0.1:1 cannot be reached" in capsys.readouterr().err
    assert not out.exists() and dask.config.get("scheduler", None) == scheduler
    assert main(words) == 0
    before = {path: path.stat().st_mtime_ns for path in (out, *out.rglob("*"))}
    assert main([*words, "--scheduler", "nowhere://127.0.0.1:1"]) == 2
    assert {path: path.stat().st_mtime_ns for path in (out, *out.rglob("*"))} == before


def test_no_scheduler_there() -> None:
    with pytest.raises(BackendError, match="cannot be reached"), backend(None, None, "tcp://127.0.0.1:1", timeout=1.0):
        pass
