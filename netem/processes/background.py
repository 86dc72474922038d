"""What can wait is done in a thread of its own, so that whoever has a time to keep does not stop for it."""

from __future__ import annotations

import queue
import sys
import threading
from collections.abc import Callable
from types import TracebackType

_EVERY_S = 0.1  # one wake-up for many calls
_TURN_S = 0.0001  # for how long it may keep the interpreter from who waits for it; Python's own is 5 ms


class Background:
    """Calls what it is given, in that order, some time later; all of it before its block ends.

    Raises
    ------
    Exception
        By `later`, and at the end of its block: what one of the calls has raised; none is made after that.
    """

    def __init__(self) -> None:
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._error: BaseException | None = None
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._work, name="background", daemon=True)

    def __enter__(self) -> Background:
        sys.setswitchinterval(_TURN_S)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()
        if error is None:
            self._raise()

    def later(self, call: Callable[[], None]) -> None:
        """Call it some time later."""
        self._raise()
        self._calls.put(call)

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

    def _work(self) -> None:
        try:
            while not self._is_over.wait(_EVERY_S):
                self._call_all()
            self._call_all()
        except BaseException as error:  # noqa: BLE001 - raised where it is given the next call, or at the end
            self._error = error

    def _call_all(self) -> None:
        while not self._calls.empty():
            self._calls.get()()
