"""The data beside the repository (../shared/data), which is not part of it: recordings that others made.

A test that needs them is skipped on a machine without them, with that reason. In CI (the variable `CI` is set, as by
`.ci/run`) they have to be there, and it fails.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def shared(name: str) -> Path:
    """A file or folder of the data; the test is skipped where it is not there, and fails in CI."""
    path = DATA / name
    if not path.exists():
        if "CI" in os.environ:
            pytest.fail(f"expected shared/data/{name} beside the repository: in CI no test is skipped for missing data")
        pytest.skip(f"shared/data/{name} is not beside the repository")
    return path


def shared_files(name: str, pattern: str) -> list[Path]:
    """The files of a folder of the data that match, in order; at least one."""
    found = sorted(shared(name).glob(pattern))
    assert found, f"expected files {pattern} in shared/data/{name} but there is none"
    return found
