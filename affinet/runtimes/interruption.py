"""Signals that ask a run to end: noted, and heeded where nothing is left half done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

_HEEDED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_BY_DEFAULT = (signal.SIG_DFL, signal.default_int_handler)


class Interrupted(KeyboardInterrupt):
    """A run was asked to end, by this signal."""

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted by {signal.Signals(number).name}")
        self.status = 128 + number


@dataclass
class Interruption:
    """Whether a signal has come: the number of the first; others are ignored, since the run is ending already.

    But while code runs that may never come to an end, a second one ends it where it is.
    """

    number: int | None = None
    _may_last: bool = False

    def heed(self) -> None:
        """Go on if no signal has come.

        Raises
        ------
        Interrupted
            If one has.
        """
        if self.number is not None:
            raise Interrupted(self.number)

    def note(self, number: int, _frame: FrameType | None) -> None:
        """Take a signal."""
        if self.number is not None and self._may_last:
            raise Interrupted(self.number)
        self.number = self.number or number

    @contextmanager
    def of_what_may_last(self) -> Iterator[None]:
        """For code of a user's own in this process."""
        self._may_last = True
        try:
            yield
        finally:
            self._may_last = False


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Signals that ask to end raise `Interrupted` where the block is, so that what it has is kept."""

    def end(number: int, _frame: FrameType | None) -> None:
        raise Interrupted(number)

    with _heeded(end):
        yield


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Note the signals that come while the block runs."""
    interruption = Interruption()
    with _heeded(interruption.note):
        yield interruption


@contextmanager
def _heeded(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Give the signals that ask to end to a handler; those that are ignored, as under nohup, stay ignored."""
    if threading.current_thread() is not threading.main_thread():  # Python gives signals to that alone
        yield
        return
    before = {number: signal.getsignal(number) for number in _HEEDED}
    heeded = [number for number, found in before.items() if found in _BY_DEFAULT]
    for number in heeded:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number in heeded:
            signal.signal(number, before[number])
