"""Waiting for processes that take as long as a busy machine lets them."""

import time

PATIENCE = 180.0


def await_true(condition, otherwise):
    """Go on once it holds; fail when it never does."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, otherwise
        time.sleep(0.02)
