"""The process that started this one: the system tells when it ends."""

from __future__ import annotations

import ctypes
import sys

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)  # found before a fork, after which it may be called


def signal_at_its_end(number: int) -> None:
    """Have the system send this process a signal when the one that started it ends; elsewhere than on Linux nothing does."""
    if sys.platform == "linux":
        _LIBC.prctl(_PR_SET_PDEATHSIG, number)
