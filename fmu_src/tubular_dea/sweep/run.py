"""Execution of a plan: missing parts are computed, and written one by one."""

from __future__ import annotations

from pathlib import Path

from ..progress import progress_bar
from .backends import Cluster, Threads
from .plan import Plan
from .store import Store

FORMAT = "{percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt} rows [{elapsed}<{remaining}{postfix}]"  # in 80 columns


def carry_out(plan: Plan, folder: Path, backend: Threads | Cluster | None = None, shown: bool = True) -> Store:
    """The results of `plan` in `folder`; parts that are there already stay. Progress is `shown`.

    Started again after it was interrupted, it goes on where it was. Raises `StoreError` for a folder that holds
    another plan's results.
    """
    store = Store.open(folder, plan)
    missing = store.missing()
    done = store.manifest.rows - sum(stop - start for start, stop in missing)
    failed = 0
    rows = store.manifest.rows
    with progress_bar(total=rows, initial=done, unit_scale=True, bar_format=FORMAT, disable=not shown) as bar:
        if missing:
            for part in (backend or Threads()).run(plan, missing):
                store.write(part)
                failed += part.failed
                if failed:
                    bar.set_postfix_str(f"{failed} cannot be computed")
                bar.update(part.stop - part.start)
    return store
