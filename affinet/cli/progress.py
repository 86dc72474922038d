"""How far something is, on standard error: a bar at a terminal, a line every few seconds, or at each step, elsewhere."""

from __future__ import annotations

import datetime
import math
import threading

from rich import progress
from rich.console import Console
from rich.text import Text

from affinet.scenario.words import one_line

EVERY_S = 5.0


class Bar:
    """A bar that is gone when it is done, or lines that stay.

    Parameters
    ----------
    title
        What goes on.
    total
        Of the steps there are.
    columns
        What the bar shows behind its title; `{task.fields[says]}` is the text that `see` is given.
    says
        That text at first.
    every_s
        Seconds from line to line; of lines that are told, and no others, infinite.
    """

    def __init__(
        self, title: str, total: int, *columns: progress.ProgressColumn, says: str = "", every_s: float = EVERY_S
    ) -> None:
        self._title, self._total, self._says = title, total, says
        self._done = 0.0
        self._console = Console(stderr=True)
        self._is_terminal = self._console.file.isatty() and not self._console.is_dumb_terminal
        self._bar = progress.Progress(
            progress.TextColumn("{task.description}", markup=False), *columns, console=self._console, transient=True
        )
        self._task = self._bar.add_task(title, total=total, says=says)
        self._every_s, self._over = every_s, threading.Event()
        self._lines = threading.Thread(target=self._say, daemon=True)

    @property
    def is_at_a_terminal(self) -> bool:
        """Whether there is a bar to see."""
        return self._is_terminal

    def __enter__(self) -> Bar:
        (self._bar if self._is_terminal else self._lines).start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_terminal:
            self._bar.stop()
        else:
            self._over.set()
            self._lines.join()

    def tell(self, line: str) -> None:
        """A line that stays, whatever the bar shows."""
        self._console.print(Text(one_line(line)), soft_wrap=True)

    def see(self, done: float, says: str) -> None:
        """Show how far it is."""
        self._done, self._says = done, says
        self._bar.update(self._task, completed=done, says=says)

    def _say(self) -> None:
        while not self._over.wait(None if self._every_s == math.inf else self._every_s):
            share = f"{int(100 * self._done / max(self._total, 1))} %"
            self.tell(f"{self._title}: {share}  {self._says}")


def left(elapsed: float, share: float) -> str:
    """About how long it takes on, as a share of it has taken so many seconds; nothing where that cannot be told yet."""
    if share <= 0.0 or elapsed <= 0.0:
        return ""
    seconds = math.ceil(elapsed * (1.0 - share) / share)
    return f"about {datetime.timedelta(seconds=seconds)} left"
