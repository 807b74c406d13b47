"""Progress of long work: a bar on standard error, where it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..progress import progress_bar


@contextmanager
def steps(shown: bool, total: int, unit: str = "step") -> Iterator[Callable[[str], None]]:
    """A function that reports the next of about `total` steps; silent unless `shown`."""
    if not shown:
        yield lambda what: None
        return
    with progress_bar(total=total, unit=unit) as bar:

        def tell(what: str) -> None:
            bar.set_postfix_str(what, refresh=False)
            bar.update()

        yield tell
