"""The launcher's end of supervision: children it started, what they tell, and how they end.

A child's standard output carries its events, so its end of file is its death, seen at once and without polling. The other
end is `netem/processes/supervised.py`.
"""

from __future__ import annotations

import selectors
import subprocess
import time
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from affinet.runtimes.child import Child, RunFailed, indented, named
from affinet.runtimes.forked import NURSERY, Nursery, end_by
from affinet.runtimes.interruption import Interruption
from affinet.runtimes.machines.coordinator import Coordinator
from affinet.runtimes.programs import ForeignProgram
from affinet.runtimes.silence import holding_up, stalled
from affinet.runtimes.told import Beat, Event
from netem.core.listing import listed
from netem.processes.supervised import BEAT_S, called
from netem.wire.session import seat_name

_GRACE_S = 1.2
# To start takes a second of processor time, and there may be a hundred on two cores.
_START_S, _START_EACH_S = 30.0, 3.0
_LATE_BEATS = 2


class ProcessGroup:
    """All children of a run; leaving the block leaves none behind.

    Its clock, `now_s`, runs only while it listens, and never for longer than it meant to: time in which the launcher itself
    was stopped, or did not come to look, is nobody's silence.
    """

    def __init__(
        self, logs: Path, patience_s: float, interruption: Interruption, machines: Coordinator | None = None
    ) -> None:
        """No children yet.

        Parameters
        ----------
        logs
            Where their standard error goes, a file each.
        patience_s
            How long nothing may move before somebody is to blame, in seconds.
        interruption
            What may ask the run to end.
        machines
            The other machines of the run.
        """
        self._logs, self._machines = logs, machines
        self._patience_s = patience_s
        self._interruption = interruption
        self._selector = selectors.DefaultSelector()
        self._nursery: Nursery | None = None
        self.now_s = self._moved_s = self._looked_s = 0.0
        self.children: list[Child] = []
        self._killed: list[dict[str, Any]] = []
        self._lost_by_killed = 0
        self._host_of: dict[str, str] = {}

    def __enter__(self) -> ProcessGroup:
        return self

    def __exit__(self, *_: object) -> None:
        self._end_all()
        if self._nursery is not None:
            self._nursery.leave(_GRACE_S)
        self._selector.close()

    @property
    def reports(self) -> list[dict[str, Any]]:
        """What the summary says of every process there was, the nursery too; last of those that were killed as scripted."""
        there = [*self.children, *([] if self._nursery is None else [self._nursery.child])]
        return [*(child.report() for child in there), *self._killed]

    @property
    def lost(self) -> int:
        """How many messages the processes say that the transport lost."""
        return self._lost_by_killed + sum(child.lost for child in self.children)

    def start_nursery(self, private: Path) -> None:
        """Start the nursery, which removes this folder when the launcher is gone, and wait until it can fork.

        Raises
        ------
        RunFailed
            When it dies or fails, or does not get anywhere for too long; or there is no such thing on this system.
        """
        with self._log(NURSERY) as log:
            self._nursery = Nursery.started(log, self._patience_s, private)
        child = self._nursery.child
        self._selector.register(child.events_fd, selectors.EVENT_READ, child)
        self.await_ready([child])

    def fork(
        self,
        role: str,
        brief: Any,
        number: int | None = None,
        *,
        trusted: bool = False,
        carrying: Collection[int] = (),
    ) -> Child:
        """Have a process forked, by the nursery here or on the machine that has its seat.

        Parameters
        ----------
        role, number
            What it is to be, and of an agent or a host which.
        brief
            What it is told.
        trusted
            Whether it runs no code of a user's own.
        carrying
            Which agents it carries, if several.

        Raises
        ------
        RunFailed
            When the nursery is gone, or does not answer.
        """
        name = named(role, number)
        self._host_of |= dict.fromkeys(map(called, carrying), name)
        with self._log(name) as log:
            child = self._forked(role, number, log, trusted)
        return self._brief(child, brief)

    def _forked(self, role: str, number: int | None, log: IO[bytes], trusted: bool) -> Child:
        name, seat = named(role, number), seat_name(role, number)
        if self._machines is not None and seat in self._machines.seats:
            remote = self._machines.start(seat, name, log)
            return Child(role, number, remote, Path(log.name), trusted, elsewhere=remote)
        assert self._nursery is not None, "start the nursery first"
        return Child(role, number, self._nursery.fork(name, log), Path(log.name), trusted)

    def start(self, role: str, command: Sequence[str], brief: Any, number: int | None = None) -> Child:
        """Start a program of somebody else's making, and give it its brief."""
        with self._log(named(role, number)) as log:
            process = ForeignProgram(command, subprocess.PIPE, log)
        return self._brief(Child(role, number, process, Path(log.name), trusted=False), brief)

    def _log(self, name: str) -> IO[bytes]:
        return (self._logs / f"{name.replace(' ', '-')}.log").open("ab")

    def _brief(self, child: Child, brief: Any) -> Child:
        self.children.append(child)
        self._selector.register(child.events_fd, selectors.EVENT_READ, child)
        child.brief(brief)
        return child

    def await_ready(self, children: Collection[Child]) -> None:
        """Wait until all of them are ready; as long as somebody gets anywhere, that may take as long as it takes.

        Raises
        ------
        RunFailed
            When one dies or fails, or none gets anywhere for too long.
        """
        patience_s = _START_S + _START_EACH_S * len(self.children)
        waiting, stopped_s = list(children), dict[str, float]()
        self._moved_s = self.now_s
        while waiting:
            self.listen()
            waiting = [child for child in waiting if not child.is_ready]
            if self.now_s - self._looked_s < BEAT_S:
                continue
            self._looked_s = self.now_s
            stopped_s = {child.name: stopped_s.get(child.name, self.now_s) for child in waiting if child.look().stopped}
            late = self.now_s - self._moved_s >= patience_s
            if late or any(self.now_s - since_s >= self._patience_s for since_s in stopped_s.values()):
                blamed = [child for child in waiting if late or child.name in stopped_s]
                why = f"{_said_of(blamed)}, and not ready: waited {self.now_s - self._moved_s:.1f} s for it"
                raise RunFailed(why + _last_lines(blamed))
        for child in children:
            child.measure()
            child.looks = None
        self._moved_s = self.now_s

    def listen(self) -> list[tuple[Child, Event]]:
        """What the children tell until the next beat is due; it may be nothing.

        Raises
        ------
        RunFailed
            When a child dies out of turn, fails, or tells what is not its own to tell.
        Interrupted
            When the run was asked to end.
        """
        self._interruption.heed()
        began_s = time.monotonic()
        ready = self._selector.select(BEAT_S)
        self.now_s += min(time.monotonic() - began_s, BEAT_S)
        if self._machines is not None and self._machines.heed():
            self._moved_s = self.now_s  # behind a link that is cut nobody is to blame
            self._forget_looks()
        return [(key.data, event) for key, _ in ready for event in self._hear(key.data)]

    def blame_the_silent(self, awaited: Collection[Child]) -> None:
        """Go on as long as something moves, or somebody works at it.

        Parameters
        ----------
        awaited
            Those for whom the launcher waits.

        Raises
        ------
        RunFailed
            When nothing moves: who is to blame.
        """
        quiet_s = self.now_s - self._moved_s
        if quiet_s < self._patience_s / 2 or self.now_s - self._looked_s < BEAT_S:
            return
        self._looked_s = self.now_s
        alive = {child.name: child for child in self.children if not child.is_done}
        beats = {name: self._lately(child) for name, child in alive.items()}
        culprits = [alive[name] for name in holding_up(beats, [child.name for child in awaited])]
        for child in culprits:
            child.look()
        if quiet_s < self._patience_s:
            return
        if not culprits:
            raise RunFailed(f"nothing moved for {quiet_s:.1f} s, and nobody is to blame: {_who_waits(beats, beats)}")
        looks = {child.name: child.looks for child in culprits if child.looks is not None}
        trusted = [child.name for child in culprits if child.trusted]
        if blamed := stalled(looks, self._patience_s, trusted):
            to_blame = [alive[name] for name in blamed]
            said = f"{_said_of(to_blame)}: nothing moved for {quiet_s:.1f} s; {_who_waits(beats, blamed)}"
            raise RunFailed(said + _last_lines(to_blame))

    def kill(self, child: Child) -> None:
        """Kill a child as the script says, wait until it is gone, and keep nothing of it but its report."""
        child.expected_to_die = True
        child.measure()
        child.process.kill()
        child.process.wait()
        self._forget(child)
        self.children.remove(child)
        self._killed.append(child.report())
        self._lost_by_killed += child.lost

    def release(self) -> None:
        """The run is over: from now on everybody may leave."""
        for child in self.children:
            child.expected_to_die = True
            child.resume()

    def await_all_gone(self) -> None:
        """Wait until every child has left; as long as they go, or work at it, that may take as long as it takes.

        Raises
        ------
        RunFailed
            When one does not leave, or left with an error.
        """
        self._moved_s = self.now_s
        staying = [child for child in self.children if child.process.poll() is None]
        while staying:
            self._await_end(staying[0])
            if len(staying) > len(staying := [child for child in staying if child.process.poll() is None]):
                self._moved_s = self.now_s
            if self.now_s - self._moved_s >= self._patience_s:
                self._blame_those_who_stay(staying)
        for child in self.children:
            if child.process.returncode:
                raise RunFailed(child.obituary())

    def _await_end(self, child: Child) -> None:
        if not child.is_mute:
            self.listen()
            return
        self._interruption.heed()
        with suppress(subprocess.TimeoutExpired):
            child.process.wait(BEAT_S)
            return
        self.now_s += BEAT_S

    def _blame_those_who_stay(self, staying: Sequence[Child]) -> None:
        for child in staying:
            with suppress(RunFailed):  # it has left by now
                child.look()
        looks = {child.name: child.looks for child in staying if child.looks is not None}
        trusted = [child.name for child in staying if child.role not in {"agent", "host"}]
        if blamed := stalled(looks, self._patience_s, trusted):
            to_blame = [child for child in staying if child.name in blamed]
            said = f"{_said_of(to_blame)}, and had not left {self.now_s - self._moved_s:.1f} s after the end of the run"
            raise RunFailed(said + _last_lines(to_blame))

    def _lately(self, child: Child) -> Beat | None:
        """What a child does, unless it has not said so for a while, or never does."""
        if child.doing is None or self.now_s - child.beat_s > _LATE_BEATS * BEAT_S:
            return None
        return child.doing._replace(
            waits=tuple(dict.fromkeys(self._host_of.get(who, who) for who in child.doing.waits))
        )

    def _hear(self, child: Child) -> list[Event]:
        before = child.doing
        events = child.hear()
        if events is None:
            self._forget(child)
            if not child.expected_to_die:
                raise RunFailed(child.obituary())
            return []
        if events or child.doing != before:
            self._moved_s = self.now_s
            self._forget_looks()
        child.beat_s = self.now_s
        return events

    def _forget_looks(self) -> None:
        for child in self.children:
            child.looks = None

    def _forget(self, child: Child) -> None:
        if not child.is_mute:
            self._selector.unregister(child.events_fd)
            child.free()

    def _end_all(self) -> None:
        if self._machines is not None:
            self._machines.give_up()
        if self._nursery is not None:
            self._nursery.child.resume()  # stopped, it could not say how the others end
        # The world goes first: it has a recording to close.
        alive = [child for child in self.children if not _has_ended(child)]
        for child in sorted(alive, key=lambda child: child.role != "world"):
            if not child.confessed:  # who has is leaving, and its log is to say of what
                child.process.terminate()
            child.resume()  # one that is stopped could not hear that it has to leave
        deadline = time.monotonic() + _GRACE_S
        for child in alive:
            with suppress(RunFailed):  # it has ended, and there is no nursery any more that would say how
                end_by(deadline, child.process)
        for child in self.children:
            child.free()


def _has_ended(child: Child) -> bool:
    try:
        return child.process.poll() is not None
    except RunFailed:  # it has, and there is no nursery any more that would say how
        return True


def _said_of(children: Sequence[Child]) -> str:
    return listed(f"{child.who} {child.looks.now if child.looks else 'is gone'}" for child in children)


def _last_lines(children: Sequence[Child]) -> str:
    """What they have said on their standard error, those who did."""
    said = ((child.name, child.last_lines) for child in children)
    return "".join(indented(f"\n  {name} said last:", lines) for name, lines in said if lines)


def _who_waits(beats: Mapping[str, Beat | None], whom: Collection[str]) -> str:
    waiting = {name: beat for name, beat in beats.items() if beat and not set(whom).isdisjoint(beat.waits)}
    said = (f"{name} waits for {_of_whom(beat)}" for name, beat in waiting.items())
    return listed(said, between="; ") or "the launcher waits for it"


def _of_whom(beat: Beat) -> str:
    return f"{listed(beat.waits)} ({beat.what}, tick {beat.tick})"
