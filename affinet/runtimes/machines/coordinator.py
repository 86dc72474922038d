"""The coordinator of a run over several machines: who has a seat elsewhere joins it, and is watched, started and told by it."""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from types import TracebackType
from typing import IO, Any

from affinet.runtimes.child import RunFailed
from affinet.runtimes.machines import joining
from affinet.runtimes.machines.identity import Identity, own
from affinet.runtimes.machines.joining import Admitted, Asked, Joining, Leave, Start
from affinet.runtimes.machines.remote import RemoteProcess
from affinet.runtimes.machines.seat import SILENT_S, Seat
from analysis.kernels import kernel as kernels
from netem.core.listing import listed
from netem.processes.supervised import BEAT_S
from netem.wire import seats
from netem.wire.carrier import Arrived, Ear, NotCarried, Question, Voice
from netem.wire.offset import SAME, ClockOffset
from netem.wire.repeating import RepeatingSession
from netem.wire.sequence import UninstructedLoss
from netem.wire.session import HUB, Login
from netem.wire.wrong import WireError

KEPT = 4096  # messages of a seat: what its processes write while a link is cut
_BACK_WITHIN_S = 1.5  # a machine whose session was closed, and not cut: else its command is dead
_MOST_LOOKED_S = 2 * BEAT_S
_ANSWERED_WITHIN_S = 5.0
_LEFT_WITHIN_S = 2.0
_LAST_S = 1.5  # once the run is given up, for answers of other machines
_ROOM = 4096
_CLOCK = "clock"
_OTHER_AFFINET = "another affinet speaks there: install the same on both"


class Coordinator:
    """The other machines of a run; leaving the block lets them go."""

    def __init__(
        self,
        login: Login,
        machines: Mapping[str, str | None],
        *,
        scenario: str,
        gone_after_s: float,
        tell: Callable[[str], None] = lambda _: None,
        identity: Identity | None = None,
    ) -> None:
        """Nobody can join yet.

        Parameters
        ----------
        login
            Where to listen, and by which certificates.
        machines
            By name of each seat elsewhere what its machine is called; None for what that calls itself.
        scenario
            The digest of what is flown.
        gone_after_s
            After how long without a word who is on the other side of a link gives up, in seconds.
        tell
            Told in a line who is still to come.
        identity
            What all have to fly with; by default what this machine does.
        """
        self._login, self._machines = login, machines
        self._scenario, self._gone_after_s = scenario, gone_after_s
        self._tell, self._identity = tell, identity or own()
        self._asked: queue.SimpleQueue[tuple[str, Question] | None] = queue.SimpleQueue()
        self._over = threading.Event()
        self._given_up_s = math.inf
        self._wrong: str | None = None
        self._threads: list[threading.Thread] = []
        self._looked_s = time.monotonic()
        self.heed_too: Callable[[], None] = lambda: None
        self.seats: dict[str, Seat] = {}

    def __enter__(self) -> Coordinator:
        config = seats.coordinator(self._login, self._machines)
        try:
            session = self._session = RepeatingSession(config, lambda *_: None, KEPT)
        except NotCarried as error:
            raise RunFailed(f"the coordinator cannot listen at {self._login.endpoint}: {error}") from error
        self.seats = {name: Seat(name, session.says(seats.down(name)), of) for name, of in self._machines.items()}
        up = session.hears(seats.up("*"), _ROOM)
        session.hands(seats.alive("*"), self._note_life)
        session.sees(seats.here("*"), self._note_presence)
        session.asks(seats.CLOCK, partial(self._put, _CLOCK))
        for name in self._machines:
            session.asks(seats.join(name), partial(self._put, name))
        beat = session.says_once(seats.BEAT)
        for run, given in ((self._beat, beat), (self._answer, None), (self._listen, up)):
            thread = threading.Thread(target=run, args=() if given is None else (given,), daemon=True)
            thread.start()
            self._threads.append(thread)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for seat in self.seats.values():
            seat.say(Leave())
        deadline_s = time.monotonic() + _LEFT_WITHIN_S
        while time.monotonic() < deadline_s and any(seat.is_here for seat in self.seats.values()):
            self._over.wait(0.05)
        self._over.set()
        self._asked.put(None)
        for thread in self._threads[:-1]:  # the last one listens, until the session is left
            thread.join()
        self._session.__exit__(kind, error, trace)
        for thread in self._threads:
            thread.join()
        for seat in self.seats.values():
            if seat.process is not None:
                seat.process.let_go()

    @property
    def awaited(self) -> list[str]:
        """Seats that nobody has taken yet."""
        return [name for name, seat in self.seats.items() if seat.joined is None]

    def await_everybody(self, heed: Callable[[], None]) -> None:
        """Wait until every seat is taken.

        Parameters
        ----------
        heed
            Called now and then; raises to break off.

        Raises
        ------
        RunFailed
            When one who was there has gone.
        """
        told: list[str] = []
        while awaited := self.awaited:
            if awaited != told:
                self._tell(f"waiting at {self._login.endpoint} for {listed(awaited)}")
            told = awaited
            heed()
            self.heed()
            self._over.wait(0.1)

    def start(self, name: str, called: str, log: IO[bytes]) -> RemoteProcess:
        """A new process in a seat: what to call it, and where its standard error goes."""
        seat = self.seats[name]
        seat.started += 1
        process = seat.process = RemoteProcess(seat.started, seat.machine or name, seat.say, self._is_over, log)
        seat.say(Start(seat.started, called))
        return process

    def heed(self) -> bool:
        """Go on if everybody who has joined is there, or may come back; whether somebody is cut off.

        Raises
        ------
        RunFailed
            When one is gone for good, or cannot go on.
        """
        self.heed_too()
        if self._wrong is not None:
            raise RunFailed(self._wrong)
        now_s = time.monotonic()
        since_s, self._looked_s = min(now_s - self._looked_s, _MOST_LOOKED_S), now_s
        joined = [seat for seat in self.seats.values() if seat.joined is not None]
        for seat in joined:
            seat.looked_at(since_s)
        if failed := [f"{seat.where}: {seat.failed}" for seat in joined if seat.failed is not None]:
            raise RunFailed(failed[0])
        if dead := [seat.where for seat in joined if seat.was_closed and seat.gone_s > _BACK_WITHIN_S]:
            raise RunFailed(f"{listed(dead)}: the command there has ended, and its processes with it")
        if gone := [seat.where for seat in joined if seat.silent_s > self._gone_after_s]:
            raise RunFailed(
                f"{listed(gone)}: not heard of for {self._gone_after_s:g} s, and given up: look at the link to that machine"
            )
        return any(seat.silent_s > SILENT_S for seat in joined)

    def give_up(self) -> None:
        """The run is over or has failed: nobody is waited for any more as long as a link may be cut."""
        self._given_up_s = time.monotonic()

    def clock(self, name: str, medium: str = HUB) -> ClockOffset:
        """How much the medium's clock shows more than that of the machine of a seat."""
        ours = self.seats[name].joined if name in self.seats else None
        theirs = self.seats[medium].joined if medium in self.seats else None
        if ours is theirs:
            return SAME
        to_coordinator = SAME if ours is None else ours.clock
        return to_coordinator.then(SAME if theirs is None else theirs.clock.back)

    def ask(self, name: str, what: Asked, within_s: float) -> bytes:
        """Ask the machine of a seat for something that is written there.

        Raises
        ------
        NotCarried
            When it does not answer.
        """
        return self._session.ask(seats.file(name), joining.pack(what), within_s)

    def asked_for(self, name: str, what: Asked) -> bytes:
        """The same, for as long as the machine may come back.

        Raises
        ------
        RunFailed
            When it does not answer.
        """
        self._looked_s = time.monotonic()
        while True:
            try:
                return self.ask(name, what, _ANSWERED_WITHIN_S)
            except NotCarried as error:
                if not self.heed():
                    raise RunFailed(f"{self.seats[name].where}: its files cannot be had: {error}") from error

    def _is_over(self) -> bool:
        if self._given_up_s == math.inf:
            self.heed()
        return time.monotonic() - self._given_up_s > _LAST_S

    def _note_life(self, arrived: Arrived) -> None:
        self._guarded(arrived, Seat.lives)

    def _note_presence(self, key: str, is_here: bool) -> None:
        self.seats[seats.seat_of(key)].is_here = is_here

    def _guarded(self, arrived: Arrived, take: Callable[[Seat, bytes], None]) -> None:
        seat = self.seats[seats.seat_of(arrived.key)]
        try:
            take(seat, arrived.data)
        except WireError as error:
            self._wrong = f"{seat.where}: {error}"

    def _beat(self, voice: Voice) -> None:
        while not self._over.wait(BEAT_S):
            voice.say(b"")

    def _listen(self, ear: Ear) -> None:
        try:
            while True:
                self._guarded(ear.next(), Seat.take)
        except (UninstructedLoss, WireError) as error:
            self._wrong = str(error)
        except NotCarried:  # the session is left
            return

    def _put(self, whom: str, question: Question) -> None:
        self._asked.put((whom, question))

    def _answer(self) -> None:
        while asked := self._asked.get():
            whom, question = asked
            with question:
                if whom == _CLOCK:
                    question.answer(joining.pack(time.monotonic()))
                elif (refused := self._admits(whom, question.data)) is not None:
                    question.refuse(refused)
                else:
                    question.answer(joining.pack(self._admission()))

    def _admission(self) -> Admitted:
        return Admitted(gone_after_s=self._gone_after_s, kernels=joining.plain_kernels(kernels.prepared()))

    def _admits(self, name: str, data: bytes) -> str | None:
        """Give a seat to who asks for it, or take it back from who has it; or why not."""
        seat = self.seats[name]
        if data == joining.GIVEN_BACK and seat.process is None:
            seat.vacate()
            return None
        try:
            asks: Any = joining.unpack(Joining, data)
        except WireError as error:
            return f"{error}; {_OTHER_AFFINET}"
        if seat.joined is not None and seat.joined != asks:
            return f"{seat.where} has joined already: end its command first, and the run with it"
        if (difference := self._identity.difference(asks.identity)) is not None:
            return f"{name} on {asks.machine} is not the same as the coordinator: {difference}"
        if asks.scenario not in (None, self._scenario):
            return f"{name} on {asks.machine} has another scenario: give it the file and the overrides that are flown"
        if name == HUB and asks.listens is None:
            return "the medium has to listen: give --listen tls/ADDRESS:PORT"
        seat.looked_at(0.0)
        seat.silent_s, seat.joined = 0.0, asks
        return None
