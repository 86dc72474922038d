"""Work in processes of their own, which end with whoever waits for it: interrupted, terminated or killed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")


def in_processes(work: Callable[[Given], Made], given: Iterable[Given]) -> Generator[Made]:
    """What comes of each, in their order, as it is done; as many at a time as there are processors.

    When whoever iterates stops, is interrupted or dies, no process is left behind.
    """
    context = multiprocessing.get_context("spawn")  # a fork would copy the threads of the libraries loaded here
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(mp_context=context, initializer=_end_with_the_parent)
    try:
        for waiting in [pool.submit(work, one) for one in given]:
            yield waiting.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    finally:
        for worker in set(multiprocessing.active_children()) - others:
            worker.kill()  # by itself it would wait for threads that a user's own code has started
        pool.shutdown()


def _end_with_the_parent() -> None:
    # Ctrl-C reaches every process of a terminal: the parent alone decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)  # whatever is under way, nobody waits for it any more

    threading.Thread(target=watch, daemon=True).start()
