"""Progress of long work on standard error: a bar on a terminal, else a line every few seconds."""

from __future__ import annotations

import sys
from threading import Event, Thread
from typing import Any

from tqdm import tqdm

EVERY = 5.0  # s between lines where the output is no terminal
SILENT = 2.0  # s of work before the first of them


class Lines(tqdm):
    """A bar for log files: each state is a line of its own, and work that is done at once has none."""

    def __init__(self, **options: Any) -> None:
        self._shown = ""
        self._ended = Event()
        self.disable: bool
        # Steps themselves show nothing: a clock of its own does, which goes on during a long one.
        never = float("inf")
        super().__init__(mininterval=never, maxinterval=never, delay=SILENT, ascii=True, ncols=100, **options)
        self._clock = Thread(target=self._tell, daemon=True)
        if not self.disable:
            self._clock.start()

    def _tell(self) -> None:
        wait = SILENT
        while not self._ended.wait(wait):
            self.refresh()
            wait = EVERY

    def display(self, msg: str | None = None, pos: int | None = None) -> bool:
        """Write the state as a line."""
        line = str(self) if msg is None else msg
        if line != self._shown:
            print(line, file=sys.stderr, flush=True)
        self._shown = line
        return True

    def close(self) -> None:
        """The last line, where there was one before."""
        self._ended.set()
        if self._clock.is_alive():
            self._clock.join()  # else its line could follow the last one
        if not self.disable and self._shown:
            self.display()
        self.leave = False
        self.disable = True


def progress_bar(**options: Any) -> Any:
    """A tqdm bar with these options, for standard error as it is."""
    return tqdm(**options) if sys.stderr.isatty() else Lines(**options)
