"""What is no file, and a cache variable that is empty: said in a line, and nothing is read or written elsewhere."""

import sys
from pathlib import Path

import pytest

from tubular_dea.cosim.heartbeats import HeartbeatError, read_r_times
from tubular_dea.export.cache import _wanted
from tubular_dea.sweep.store import Store, StoreError

DEVICE = Path("/dev/null")
devices = pytest.mark.skipif(sys.platform == "win32", reason="there are no device files on Windows")


@devices
def test_a_device_holds_no_r_times():
    with pytest.raises(HeartbeatError, match="expected a file"):
        read_r_times(DEVICE)


@devices
def test_a_device_is_no_manifest(tmp_path):
    (tmp_path / "manifest.json").symlink_to(DEVICE)
    with pytest.raises(StoreError, match="expected a file"):
        Store.read(tmp_path)


def test_an_empty_cache_variable_is_one_that_is_not_set(monkeypatch):
    monkeypatch.setenv("HOME", "/somewhere")
    for name in ("TUBULAR_DEA_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, "")
    wanted = _wanted()
    assert wanted is not None and wanted.is_absolute() and wanted.name == "tubular-dea"
