"""Work in processes of their own, which end with whoever waits for it: interrupted, terminated or killed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, MutableSequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, ProcessPoolExecutor, wait
from dataclasses import dataclass

from affinet.studies.executor import LOOKS_S, Executor, Given, Here, Lost, Made, Telling, Watch, numbered


def on_this_machine(jobs: int | None = None) -> Executor:
    """So many processes, by default as many as there are processors; for one job, this one."""
    jobs = jobs or os.cpu_count() or 1
    return Here() if jobs == 1 else Processes(jobs)


@dataclass(frozen=True)
class Processes:
    """Processes of this machine, as many as pieces of work are done at once.

    When whoever iterates over what they do stops, is interrupted or dies, no process is left behind.
    """

    at_once: int

    def each(self, work: Callable[[Given], Made], given: Iterable[Given], watch: Watch) -> Generator[tuple[int, Made]]:
        """As `Executor.each`."""
        context = multiprocessing.get_context("spawn")  # a fork would copy the threads of the libraries loaded here
        others = set(multiprocessing.active_children())
        todo = list(given)
        shares = context.RawArray("d", len(todo))
        pool = ProcessPoolExecutor(self.at_once, mp_context=context, initializer=_begin, initargs=(shares,))
        try:
            waiting = {pool.submit(numbered, work, number, one): number for number, one in enumerate(todo)}
            while waiting:
                done, _ = wait(waiting, timeout=LOOKS_S, return_when=FIRST_COMPLETED)
                if not done:
                    watch(list(shares))
                for one in sorted(done, key=lambda future: waiting[future]):
                    yield waiting.pop(one), one.result()
        except BrokenExecutor as error:
            raise Lost("a process that flew cases is gone, for want of memory perhaps") from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        finally:
            for worker in set(multiprocessing.active_children()) - others:
                worker.kill()  # by itself it would wait for threads that a user's own code has started
            pool.shutdown()


def _begin(shares: MutableSequence[float]) -> None:
    Telling.shares = shares
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
