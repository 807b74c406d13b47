"""What is compiled for a discovery, and together with what."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import tubular_dea as td
from tubular_dea.identify.fitting.compiled import SWITCHING, Compiled
from tubular_dea.kernel import trajectories

SILVERBOX = Path(__file__).resolve().parents[1] / "cosim_examples" / "plants" / "silverbox.py"


@pytest.fixture(scope="module")
def groups() -> list[set[str]]:
    """The laws of the silverbox that share a library for the scores of 1000 samples."""
    kernels = Compiled(td.load_plant(SILVERBOX), points=1000).scorers(())
    return [set(kernel.model.effects) for kernel in {id(k): k for k in kernels.values()}.values()]


def test_every_law_is_scored_in_one_library(groups: list[set[str]]) -> None:
    """None is left out, and none is carried along where it is not scored: each costs time at every step."""
    assert sorted(name for group in groups for name in group) == sorted(td.load_plant(SILVERBOX).catalogue)


def test_delays_are_scored_apart(groups: list[set[str]]) -> None:
    """They double the points at which the inputs bend, for all in their library."""
    late = {"delay(force)", "echo(force)", "delay(displacement)"}
    assert [group for group in groups if group & late] == [late]


def test_few_laws_that_switch_share_a_library(groups: list[set[str]]) -> None:
    """Each shortens the steps of the others."""
    switching = {
        "dry_friction(velocity)",
        *(n for n in td.load_plant(SILVERBOX).catalogue if n.startswith("hysteresis")),
    }
    assert all(len(group) <= SWITCHING for group in groups if group & switching)


def test_a_simulation_compiles_no_sensitivities(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take longer to compile than the rest."""

    def refused(*_: object) -> None:
        raise AssertionError("sensitivities were compiled")

    monkeypatch.setattr(trajectories, "kernel_library", refused)
    assert td.simulate(td.tube(), pressure="95 mmHg", voltage="0 V", stop=0.01).time.size > 0


def test_what_only_the_search_needs_is_imported_while_the_compiler_works() -> None:
    """`close-loop` reads recordings, and begins to compile, before SciPy's signals and statistics are loaded."""
    asked = "import sys, tubular_dea.commands.close_loop; print({'scipy.signal', 'scipy.stats'} & {*sys.modules})"
    said = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "set()"
