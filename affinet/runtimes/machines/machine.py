"""The command on a machine (`affinet agent 3 --connect ...`): it holds seats of a run, forks their processes, and watches them.

It is to its processes what the launcher is on one machine: their standard input is their lifeline, and with its end they end.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NoReturn

from affinet.runtimes.child import RunFailed
from affinet.runtimes.forked import NURSERY, Nursery, end_by
from affinet.runtimes.machines import joining
from affinet.runtimes.machines.identity import Identity, own
from affinet.runtimes.machines.joining import Admitted, Down, Failed, Joining, Leave, Say, Shut, Signal, Start
from affinet.runtimes.machines.place import Place, Refused, of_folder, own_name
from affinet.runtimes.machines.seat import SILENT_S
from affinet.runtimes.private import private_folder
from netem.processes.supervised import BEAT_S
from netem.processes.system_errors import said
from netem.wire import endpoints
from netem.wire.carrier import Question
from netem.wire.session import Login
from netem.wire.wrong import WireError

_GRACE_S = 1.2
_READY_S = 60.0
_PATIENCE_S = 10.0
_PROBED_S = 0.5
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class Wanted:
    """What a command was told.

    Parameters
    ----------
    names
        Of the seats to hold.
    connect
        Where the coordinator listens.
    keys
        The folder with the certificates.
    listen
        Where the medium is to listen.
    scenario
        The digest of the scenario it was given.
    identity
        What it flies with, by default what there is.
    """

    names: tuple[str, ...]
    connect: str
    keys: str
    listen: str | None = None
    scenario: str | None = None
    identity: Identity | None = None


class CoordinatorGone(RuntimeError):
    """The coordinator has ended, or was not heard of for too long."""


def serve(wanted: Wanted, tell: Callable[[str], None]) -> None:
    """Hold the seats until the run is over.

    Raises
    ------
    Refused
        When the coordinator cannot be reached, or does not take this machine.
    CoordinatorGone
        When it is gone; nothing runs here any more.
    RunFailed
        When no process can be started here.
    """
    for number in _ENDING:
        signal.signal(number, _end)
    with private_folder() as folder, Machine(folder) as machine:
        machine.join(wanted)
        tell(f"joined {wanted.connect}: {', '.join(wanted.names)}")
        machine.run()


def _end(number: int, _frame: object) -> NoReturn:
    raise SystemExit(128 + number)


class Machine:
    """The seats of one command; leaving the block leaves nothing running.

    Parameters
    ----------
    folder
        For files of the processes.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stack = ExitStack()
        self._places: list[Place] = []
        self._nursery: Nursery | None = None
        self._given: list[tuple[Place, Down | Question | Exception]] = []
        self._taking = threading.Lock()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._over = threading.Event()
        self._watching: threading.Thread | None = None
        self._gone: str | None = None
        self._leaves = False

    def __enter__(self) -> Machine:
        return self

    def __exit__(self, *failure: object) -> None:
        self._over.set()
        for number in _ENDING:
            signal.signal(number, signal.SIG_IGN)  # it ends already
        self._end_all()
        self._stack.close()
        if self._watching is not None:
            self._watching.join()
        os.close(self._wake)  # nobody who would write to it is left

    def join(self, wanted: Wanted) -> None:
        """Take the seats, all or none, and make ready to fork."""
        kernels: dict[str, list[list[int]]] = {}
        try:
            for name in wanted.names:
                admitted = self._take_seat(name, wanted)
                for joined in self._places:  # to join takes a while where there are many
                    joined.beat()
                kernels |= admitted.kernels
        except Refused:
            for joined in self._places:
                joined.give_back()
            raise
        address = endpoints.over_machines(wanted.connect)
        self._watching = threading.Thread(target=self._watch, args=(address, admitted.gone_after_s), daemon=True)
        self._watching.start()
        self._start_nursery(kernels)

    def _take_seat(self, name: str, wanted: Wanted) -> Admitted:
        keys = str(Path(wanted.keys).absolute())
        place = self._stack.enter_context(Place(Login(wanted.connect, name, keys=keys), self._take))
        asks = Joining(
            seat=name,
            machine=own_name(),
            folder=str(self._folder),
            keys=keys,
            identity=wanted.identity or own(),
            scenario=wanted.scenario,
            listens=wanted.listen,
            clock=place.clock(),
        )
        admitted = place.join(asks)
        self._places.append(place)
        return admitted

    def run(self) -> None:
        """Start, relay and end processes as the coordinator says, until the run is over."""
        due_s = time.monotonic()
        while not self._leaves:
            if self._gone is not None:
                raise CoordinatorGone(self._gone)
            if (now_s := time.monotonic()) >= due_s:
                due_s = now_s + BEAT_S
                for place in self._places:
                    place.beat()
            self._await_something(due_s - now_s)
            self._obey()
            for place in self._places:
                place.relay()
                place.ended()

    def _start_nursery(self, kernels: dict[str, list[list[int]]]) -> None:
        prepared = {name: [(sizes, None) for sizes in of_one] for name, of_one in kernels.items()}
        with self._log(NURSERY) as log:
            self._nursery = Nursery.started(log, _PATIENCE_S, self._folder, json.dumps(prepared))
        child = self._nursery.child
        deadline_s = time.monotonic() + _READY_S
        while not child.is_ready:
            if self._gone is not None:
                raise CoordinatorGone(self._gone)
            if time.monotonic() > deadline_s:
                raise RunFailed(f"{child.who} was not ready after {_READY_S:g} s")
            if select.select([child.events_fd], [], [], BEAT_S)[0] and child.hear() is None:
                raise RunFailed(child.obituary())
            for place in self._places:
                place.beat()

    def _await_something(self, within_s: float) -> None:
        assert self._nursery is not None
        poll = select.poll()
        for fd in (self._wake, self._nursery.fileno()):
            poll.register(fd, select.POLLIN)
        for place in self._places:
            if place.process is not None:
                for fd in place.open_fds:
                    poll.register(fd, select.POLLIN)
                if place.pending and not place.process.stdin.closed:
                    poll.register(place.process.stdin, select.POLLOUT)
        found = dict(poll.poll(max(0.0, 1000.0 * within_s)))
        if self._wake in found:
            with suppress(BlockingIOError):
                os.eventfd_read(self._wake)
        if self._nursery.fileno() in found:
            self._nursery.hear()

    def _take(self, place: Place, given: Down | Question | Exception) -> None:
        with self._taking:
            self._given.append((place, given))
        os.eventfd_write(self._wake, 1)

    def _obey(self) -> None:
        with self._taking:
            given, self._given = self._given, []
        for place, order in given:
            match order:
                case Question():
                    self._give(order)
                case Exception():
                    raise CoordinatorGone(f"the coordinator cannot be heard any more: {order}")
                case Start(number=number, name=name):
                    self._start(place, number, name)
                case Leave():
                    self._leaves = True
                case Say(data=data) if order.number == place.number:
                    place.pending += data
                case Shut() if order.number == place.number:
                    place.is_shut = True
                case Signal(signal=which) if order.number == place.number and place.process is not None:
                    place.process.send_signal(which)

    def _give(self, question: Question) -> None:
        with question:
            try:
                question.answer(of_folder(self._folder, joining.unpack(joining.Asked, question.data)))
            except (OSError, WireError) as error:
                question.refuse(said(error) if isinstance(error, OSError) else str(error))

    def _start(self, place: Place, number: int, name: str) -> None:
        assert self._nursery is not None
        reads, writes = os.pipe()
        try:
            with os.fdopen(writes, "wb") as log:
                process = self._nursery.fork(name, log)
        except (OSError, RunFailed) as error:
            os.close(reads)
            place.tell(Failed(said(error) if isinstance(error, OSError) else str(error)))
            return
        place.started(number, process, reads)

    def _log(self, name: str) -> IO[bytes]:
        return (self._folder / f"{name}.log").open("ab")

    def _end_all(self) -> None:
        living = [place for place in self._places if place.process is not None]
        for place in living:
            place.ask_to_leave()
        deadline_s = time.monotonic() + _GRACE_S
        for place in living:
            assert place.process is not None
            with suppress(RunFailed):  # it has ended, and there is no nursery any more that would say how
                end_by(deadline_s, place.process)
            place.ended()
        if self._nursery is not None:
            self._nursery.leave(_GRACE_S)

    def _watch(self, address: tuple[str, int], gone_after_s: float) -> None:
        """See when the coordinator is gone; while this machine was stopped itself, nobody was silent."""
        silent_s = 0.0
        while not self._over.wait(BEAT_S):
            if any(place.beaten.is_set() for place in self._places):
                silent_s = 0.0
                for place in self._places:
                    place.beaten.clear()
                continue
            silent_s += BEAT_S
            if silent_s >= SILENT_S and _nobody_listens(address):
                self._gone = f"the coordinator has ended: nobody listens at {address[0]} port {address[1]} any more"
            elif silent_s >= gone_after_s:
                self._gone = f"the coordinator was not heard of for {gone_after_s:g} s"
            if self._gone is not None:
                os.eventfd_write(self._wake, 1)
                return


def _nobody_listens(address: tuple[str, int]) -> bool:
    """Whether its machine says so: one that cannot be reached says nothing."""
    try:
        with socket.create_connection(address, _PROBED_S):
            return False
    except ConnectionRefusedError:
        return True
    except OSError:
        return False
