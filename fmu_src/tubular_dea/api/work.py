"""Progress of long work: a bar on standard error, where it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..progress import progress_bar


@contextmanager
def steps(shown: bool, total: int | None, unit: str = "step") -> Iterator[Callable[[str], None]]:
    """A function that reports the next of `total` steps (None: nobody knows how many); silent unless `shown`."""
    if not shown:
        yield lambda what: None
        return
    counted = {} if total is not None else {"bar_format": "{elapsed}{postfix}"}  # what it does says more than how often
    with progress_bar(total=total, unit=unit, **counted) as bar:

        def tell(what: str) -> None:
            bar.set_postfix_str(what, refresh=False)
            bar.update()

        yield tell
