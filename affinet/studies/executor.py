"""Where the cells of a study fly: the one seam between a study and whoever does its work.

Here, one after the other, for one job; `pool.py` has processes of this machine, `cluster.py` the workers of a Dask cluster.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterable, Iterator, MutableSequence, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")
Watch = Callable[[Sequence[float]], None]

LOOKS_S = 0.5  # seconds from one look at how far the work is to the next


class Lost(RuntimeError):
    """Who did the work is gone, and did not say why: what is lost with them, in plain words."""


class Executor(Protocol):
    """Where work is done, and at how many pieces of it at a time."""

    @property
    def at_once(self) -> int:
        """How many pieces of work are done at a time."""
        ...

    def each(self, work: Callable[[Given], Made], given: Iterable[Given], watch: Watch) -> Generator[tuple[int, Made]]:
        """What comes of each with its number, as it is done, in whatever order.

        Parameters
        ----------
        work, given
            What to do, and with what: both can be pickled.
        watch
            Told from time to time, while there is something to wait for, which share of each is done, as `tell` says.

        Raises
        ------
        Lost
            When who does the work is gone.
        """
        ...


class Telling:
    """Where the work at hand in this process says how far it is; nowhere outside of an executor."""

    shares: ClassVar[MutableSequence[float]] = [0.0]
    number: ClassVar[int] = 0


def tell(share: float) -> None:
    """Say which share of the work at hand is done, from within it."""
    Telling.shares[Telling.number] = share


def numbered(work: Callable[[Given], Made], number: int, given: Given) -> Made:
    """Do the piece of work of this number, which says how far it is under it."""
    Telling.number = number
    made = work(given)
    tell(1.0)
    return made


@dataclass(frozen=True)
class Here:
    """This process, in which one piece of work is done after the other."""

    at_once: int = 1

    def each(self, work: Callable[[Given], Made], given: Iterable[Given], watch: Watch) -> Generator[tuple[int, Made]]:
        """As `Executor.each`, in their order."""
        todo = list(given)
        shares = Telling.shares = [0.0] * len(todo)
        for number, one in enumerate(todo):
            with _looked_at(lambda: watch(list(shares))):
                made = numbered(work, number, one)
            yield number, made


@contextmanager
def _looked_at(look: Callable[[], None]) -> Iterator[None]:
    """Look from time to time while the block works."""
    over = threading.Event()

    def go_on() -> None:
        while not over.wait(LOOKS_S):
            look()

    looking = threading.Thread(target=go_on, daemon=True)
    looking.start()
    try:
        yield
    finally:
        over.set()
        looking.join()
