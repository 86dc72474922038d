"""Imports while somebody may lose patience."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def ctrl_c_left_to_the_system() -> Iterator[None]:
    """For imports: a library that meets Ctrl-C meanwhile may raise what it likes in its place."""
    ours = (
        threading.current_thread() is threading.main_thread()  # no other may say what signals do
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if ours:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    yield
    if ours:
        signal.signal(signal.SIGINT, signal.default_int_handler)
