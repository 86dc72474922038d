"""Work on an existing Dask cluster, whose workers have to give the bits that this process would."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from affinet.scenario.words import one_line
from affinet.studies import identity
from affinet.studies.executor import LOOKS_S, Given, Lost, Made, Watch
from affinet.studies.identity import Identity, Module

if TYPE_CHECKING:
    from distributed import Client

_CONNECT_S = 10
_PATIENCE_S = 60.0  # without any worker: one that a nanny starts again takes some seconds
_EXTRA = "pip install 'affinet[cluster]'"


class NoCluster(OSError):
    """There is no cluster to fly on: why, in plain words."""


class OtherBits(RuntimeError):
    """A worker would give other bits: of what its own come, and those of who asks."""


@contextmanager
def connected(address: str, own: Sequence[Module]) -> Iterator[Workers]:
    """The workers of the scheduler at an address, for flights with these modules of a user's own.

    Raises
    ------
    NoCluster
        When Dask is not installed, nobody answers, there is no worker, or one would give other bits.
    """
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address, parse_host_port
        from distributed.comm.registry import get_backend
    except ImportError as error:
        raise NoCluster(f"--dask wants Dask's distributed, which is not installed: {_EXTRA}") from error
    try:
        scheme, where = parse_address(address)
        get_backend(scheme)
        parse_host_port(where)
        client = Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError, ImportError) as error:
        said = f"no Dask scheduler at {address!r}: {error}; give an address like tcp://host:8786, where one is started"
        raise NoCluster(one_line(said)) from error
    with client:
        ours = identity.here(own)
        yield Workers(client, _of_same_bits(client, address, own, ours), ours, tuple(own))


@dataclass(frozen=True)
class Workers:
    """The workers of a Dask cluster, each a process that flies one batch at a time.

    Parameters
    ----------
    client
        Who asks them.
    at_once
        How many there were at first.
    of, own
        What the bits come of, and the modules of a user's own that fly.
    """

    client: Client
    at_once: int
    of: Identity
    own: tuple[Module, ...]

    def each(self, work: Callable[[Given], Made], given: Iterable[Given], watch: Watch) -> Generator[tuple[int, Made]]:
        """As `Executor.each`; a batch whose worker is gone is flown by another, and one that flies says not how far it is."""
        from distributed import wait
        from distributed.scheduler import KilledWorker

        todo = list(given)
        shares, alone_s = [0.0] * len(todo), 0.0
        flying = {
            self.client.submit(_there, self.of, self.own, work, one, pure=False): number
            for number, one in enumerate(todo)
        }
        try:
            while flying:
                try:
                    done = wait([*flying], timeout=LOOKS_S, return_when="FIRST_COMPLETED").done
                except TimeoutError:
                    alone_s = 0.0 if self._are_there() else alone_s + LOOKS_S
                    if alone_s > _PATIENCE_S:
                        raise Lost(f"the cluster has had no worker for {_PATIENCE_S:g} s") from None
                    continue
                for one in sorted(done, key=flying.__getitem__):
                    number = flying.pop(one)
                    made = one.result()
                    shares[number] = 1.0
                    watch(list(shares))
                    yield number, made
        except KilledWorker as error:
            raise Lost("workers that flew one and the same batch are gone, for want of memory perhaps") from error
        except CancelledError as error:
            raise Lost("the Dask scheduler is gone") from error
        except OtherBits as error:
            raise Lost(str(error)) from error
        finally:
            if self.client.status == "running":
                self.client.cancel([*flying])

    def _are_there(self) -> bool:
        if self.client.status != "running":
            raise Lost("the Dask scheduler is gone")
        return bool(self.client.scheduler_info()["workers"])


def _of_same_bits(client: Client, address: str, own: Sequence[Module], ours: Identity) -> int:
    """How many workers there are, all of which would give the bits that this process would."""
    found: dict[str, Any] = client.run(identity.here, own, on_error="return")
    if not found:
        raise NoCluster(f"the Dask scheduler at {address!r} has no workers: start some, like `dask worker {address}`")
    for worker, theirs in found.items():
        if isinstance(theirs, BaseException):
            said = f"worker {worker} cannot fly: {type(theirs).__name__}: {theirs}"
            raise NoCluster(one_line(f"{said}; install there what is installed here, affinet {ours['affinet']}"))
        if theirs != ours:
            raise NoCluster(one_line(_other(f"worker {worker}", theirs, ours)))
    return len(found)


def _other(worker: str, theirs: Identity, ours: Identity) -> str:
    different = ", ".join(identity.differences(theirs, ours))
    return f"{worker} would give other bits: it differs in {different}; install there what is installed here"


_ONE_AT_A_TIME = threading.Lock()  # a worker may have many threads; modules of a user's own are one process's


def _there(of: Identity, own: Sequence[Module], work: Callable[[Given], Made], given: Given) -> Made:
    """Do a piece of work in a worker: one may have come, or have been changed, since all were asked."""
    with _ONE_AT_A_TIME:
        if (here := identity.here(own)) != of:
            raise OtherBits(_other("a worker", here, of))
        return work(given)
