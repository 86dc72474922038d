"""Exit statuses of commands, beside those of signals."""

from __future__ import annotations

PASS, FAIL, BAD_INPUT, USER_CODE, INTERRUPTED = 0, 1, 2, 3, 130
