"""What is done later is done in order, all of it, and tells of what goes wrong."""

from __future__ import annotations

import threading

import pytest

from netem.processes.background import Background


def test_all_is_called_in_order_by_the_end_in_another_thread() -> None:
    called: list[tuple[int, int]] = []
    with Background() as background:
        for number in range(1000):
            background.later(lambda number=number: called.append((number, threading.get_ident())))
    assert [number for number, _ in called] == list(range(1000))
    assert {thread for _, thread in called}.isdisjoint({threading.get_ident()})


def test_what_goes_wrong_is_raised_at_the_end_and_nothing_is_called_after_it() -> None:
    def fail() -> None:
        raise OSError("the disk is full")

    called: list[int] = []
    with pytest.raises(OSError, match="disk is full"), Background() as background:  # noqa: PT012
        background.later(fail)
        background.later(lambda: called.append(1))
    assert not called


def test_what_goes_wrong_is_raised_by_the_next_that_is_given() -> None:
    failed = threading.Event()

    def fail() -> None:
        failed.set()
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="disk is full"), Background() as background:  # noqa: PT012
        background.later(fail)
        assert failed.wait(60.0)
        background._thread.join()
        background.later(lambda: None)
        pytest.fail("it was given more")


def test_an_error_of_the_block_goes_before_one_of_a_call() -> None:
    def fail() -> None:
        raise OSError("the disk is full")

    with pytest.raises(ValueError, match="of the block"), Background() as background:  # noqa: PT012
        background.later(fail)
        raise ValueError("of the block")
