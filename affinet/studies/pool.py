"""Work in processes of their own, which end with whoever waits for it: interrupted, terminated or killed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, MutableSequence, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from typing import ClassVar, TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")

_LOOKS_S = 0.5  # seconds from one look at how far the others are to the next


class _Telling:
    """Where the work of this process says how far it is; nowhere outside of a pool."""

    shares: ClassVar[MutableSequence[float]] = [0.0]
    number: ClassVar[int] = 0


def processors() -> int:
    """How many there are, and so at how many pieces of work a pool is at a time."""
    return os.cpu_count() or 1


def tell(share: float) -> None:
    """Say which share of the work at hand is done, from within it."""
    _Telling.shares[_Telling.number] = share


def in_processes(
    work: Callable[[Given], Made],
    given: Iterable[Given],
    watch: Callable[[Sequence[float]], None] = lambda _: None,
) -> Generator[Made]:
    """What comes of each, in their order, as it is done; as many at a time as there are processors.

    When whoever iterates stops, is interrupted or dies, no process is left behind.

    Parameters
    ----------
    work, given
        What to do, and with what.
    watch
        Told from time to time, while there is something to wait for, which share of each is done, as `tell` says.
    """
    context = multiprocessing.get_context("spawn")  # a fork would copy the threads of the libraries loaded here
    others = set(multiprocessing.active_children())
    todo = list(given)
    shares = context.RawArray("d", len(todo))
    pool = ProcessPoolExecutor(processors(), mp_context=context, initializer=_begin, initargs=(shares,))
    try:
        for waiting in [pool.submit(_work, work, number, one) for number, one in enumerate(todo)]:
            while not wait([waiting], timeout=_LOOKS_S).done:
                watch(list(shares))
            yield waiting.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    finally:
        for worker in set(multiprocessing.active_children()) - others:
            worker.kill()  # by itself it would wait for threads that a user's own code has started
        pool.shutdown()


def _work(work: Callable[[Given], Made], number: int, given: Given) -> Made:
    _Telling.number = number
    made = work(given)
    tell(1.0)
    return made


def _begin(shares: MutableSequence[float]) -> None:
    _Telling.shares = shares
    _end_with_the_parent()


def _end_with_the_parent() -> None:
    # Ctrl-C reaches every process of a terminal: the parent alone decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)  # whatever is under way, nobody waits for it any more

    threading.Thread(target=watch, daemon=True).start()
