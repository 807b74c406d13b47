"""Progress of long work on standard error: a bar on a terminal, else a line every few seconds."""

from __future__ import annotations

import sys
from threading import Timer
from typing import Any

from tqdm import tqdm

EVERY = 5.0  # s between lines where the output is no terminal
SILENT = 2.0  # s of work before the first of them


class Lines(tqdm):
    """A bar for log files: each state is a line of its own, and work that is done at once has none."""

    def __init__(self, **options: Any) -> None:
        self._shown = ""
        self.disable: bool
        super().__init__(mininterval=EVERY, maxinterval=EVERY, delay=SILENT, ascii=True, ncols=100, **options)
        self._first = Timer(SILENT, self.refresh)  # also of work whose one step is long
        self._first.daemon = True
        if not self.disable:
            self._first.start()

    def display(self, msg: str | None = None, pos: int | None = None) -> bool:
        """Write the state as a line."""
        line = str(self) if msg is None else msg
        if line != self._shown:
            print(line, file=sys.stderr, flush=True)
        self._shown = line
        return True

    def close(self) -> None:
        """The last line, where there was one before."""
        self._first.cancel()
        if not self.disable and self._shown:
            self.display()
        self.leave = False
        self.disable = True


def progress_bar(**options: Any) -> Any:
    """A tqdm bar with these options, for standard error as it is."""
    return tqdm(**options) if sys.stderr.isatty() else Lines(**options)
