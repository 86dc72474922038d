"""Fly against one agent: the suite is its launcher, its medium and its world, and takes down what comes."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

import msgspec
import numpy as np

from affinet.conformance.air import Air
from affinet.conformance.attention import Attention
from affinet.conformance.flights import Flight
from affinet.conformance.program import Program
from affinet.conformance.record import ACT, Asked, Life, Record
from affinet.conformance.star import Star
from affinet.planning.plan import Plan
from affinet.runtimes.briefs import agent_brief
from affinet.runtimes.private import socket_folder
from agents.node import AgentBrief
from analysis.models.arrays import Array
from netem.core.clock import Lockstep
from netem.core.listing import listed
from netem.faults.timeline import Timeline
from netem.medium.relay import Relayed
from netem.wire import messages
from netem.wire.arrays import numbers
from netem.wire.session import HUB
from netem.wire.wrong import WireError
from world.flight import fly
from world.physics.world import Scene


@dataclass(frozen=True)
class Patience:
    """How long it may do nothing, in seconds: until it is ready, and until it answers or leaves."""

    ready_s: float = 30.0
    answer_s: float = 3.0


class Steered(NamedTuple):
    """What came of a tick: what all steer, shape (N, D)."""

    input: Array


class Stopped(Exception):
    """The flight cannot go on: why."""


def flown(flight: Flight, plan: Plan, command: list[str], patience: Patience) -> Record:
    """What came of a flight against the agent that a command line starts.

    Parameters
    ----------
    flight, plan
        How it goes, and what is flown.
    command
        What starts the agent.
    patience
        How long it may do nothing.

    Raises
    ------
    OSError
        When it cannot be started.
    """
    record = Record(plan, flight.agent)
    with ExitStack() as stack:
        private = tempfile.TemporaryDirectory(prefix="affinet-", dir=socket_folder(), ignore_cleanup_errors=True)
        folder = Path(stack.enter_context(private))
        happened = SimpleQueue[Any]()
        star = stack.enter_context(Star(folder, flight.agent, happened))
        conversation = Conversation(record, star, Attention(record, happened), command, folder, patience)
        stack.callback(conversation.end_all)
        try:
            conversation.hold(flight)
        except Stopped as stopped:
            record.stopped = str(stopped)
    return record


class Conversation:
    """A flight against one agent; to `world.flight.fly` it is what carries messages.

    Parameters
    ----------
    record
        What is filled.
    star, attention
        How to speak to the agent, and to hear it.
    command, folder
        What starts it, and where its logs and its memory lie.
    patience
        How long it may do nothing.
    """

    def __init__(
        self, record: Record, star: Star, attention: Attention, command: list[str], folder: Path, patience: Patience
    ) -> None:
        self._record, self._star, self._attention = record, star, attention
        self._command, self._folder, self._patience = command, folder, patience
        self._air = Air(record.plan, record.agent)
        self._programs: list[Program] = []
        self._inboxes = self._tellings = 0
        self._flying = np.zeros(record.plan.world.formation.dimension)
        self._given_up: set[str] = set()  # streams on which nothing comes: once is waited for them

    @property
    def timeline(self) -> Timeline:
        """The faults of the flight."""
        return self._air.timeline

    def hold(self, flight: Flight) -> None:
        """From its start to its end.

        Raises
        ------
        Stopped
            When it does not get there.
        """
        if flight.ending == "orphaned early":
            self._begin().half_brief(self._brief(remembers=False))
            self._await_leaving()
            return
        self._start(remembers=False)
        if flight.ticks:
            with np.errstate(over="ignore", invalid="ignore"):  # what it steers is up to it
                for _ in fly(self._record.plan.world, Lockstep(flight.ticks), self):
                    pass
        match flight.ending:
            case "end":
                self._hand(messages.pack(messages.EndInbox(k=flight.ticks, src=HUB, seq=self._inboxes)))
            case "orphaned":
                self._program.orphan()
            case spoiling:
                self._spoil(spoiling, flight.ticks)
        self._await_leaving()

    def fire(self, tick: int, triggers: object) -> None:
        """No flight of the suite waits for a condition."""

    def carry(self, tick: int, scene: Scene, measured: Array) -> Steered:
        """One tick of the agent; all others hold."""
        self._move_process(tick)
        relayed = self._air.decide(tick, scene)
        row, steered = self._record.agent - 1, np.zeros_like(scene.position)
        if relayed.awake[row]:
            self._sense(relayed, scene, measured)
            self._flying = steered[row] = self._exchange(relayed)
        return Steered(steered)

    def end_all(self) -> None:
        """Leave no process behind."""
        for program in self._programs:
            program.kill()

    @property
    def _program(self) -> Program:
        return self._programs[-1]

    @property
    def _life(self) -> Life:
        return self._record.lives[-1]

    def _move_process(self, tick: int) -> None:
        agent = self._record.agent
        if agent in self.timeline.killed(tick):
            self._program.kill()
        if agent in self.timeline.restarted(tick):
            self._inboxes, self._flying = 0, np.zeros_like(self._flying)
            self._start(remembers=agent in self.timeline.remembering(tick))
        if agent in self.timeline.paused(tick):
            self._program.child.pause()
        if agent in self.timeline.resumed(tick):
            self._program.child.resume()

    def _begin(self) -> Program:
        life = len(self._programs)
        happened = self._attention.happened
        log = self._folder / f"agent-{life}.log"
        self._record.lives.append(Life())
        self._programs.append(Program(self._command, self._record.agent, life, log, happened))
        return self._program

    def _brief(self, *, remembers: bool) -> AgentBrief:
        plan, agent = self._record.plan, self._record.agent
        checkpoint = str(self._folder / "memory.npz") if agent in plan.timeline.warm else None
        return agent_brief(plan, self._star.run, self._star.login, agent, checkpoint=checkpoint, remembers=remembers)

    def _start(self, *, remembers: bool) -> None:
        program, life = self._begin(), self._life
        program.brief(self._brief(remembers=remembers))
        if not self._attention.waits(program, lambda: life.ready, self._patience.ready_s):
            self._stop("it is not ready")
        if not self._attention.waits(program, lambda: self._star.is_heard, self._patience.answer_s):
            self._stop("it said that it is ready, and does not subscribe to its inbox")

    def _sense(self, relayed: Relayed, scene: Scene, measured: Array) -> None:
        inbox = self._air.sensed(relayed, scene, measured, self._inboxes)
        asked = Asked(relayed.tick, "sense", len(self._programs) - 1, inbox.clock, flying=self._flying)
        self._ask(asked, messages.pack(inbox), self._record.channels)

    def _exchange(self, relayed: Relayed) -> Array:
        handed = self._air.heard(relayed)
        asked = Asked(relayed.tick, "exchange", len(self._programs) - 1, 0, tuple(handed))
        inbox = messages.pack_exchange(relayed.tick, self._inboxes, [self._air.said(one) for one in handed])
        if self._record.plan.centre:
            self._star.tell(self._air.told(relayed.tick, self._tellings))
            self._tellings += 1
        self._ask(asked, inbox, [ACT])
        return self._steered()

    def _steered(self) -> Array:
        """What the body flies from now on: what it said since it was asked, or nothing where that is no input."""
        still, asked = np.zeros_like(self._flying), len(self._record.asked)
        acts = (said for said in self._record.said if said.after == asked and said.stream == ACT)
        try:
            return numbers(next(acts).fields.get("input"), "input", still.shape)
        except (StopIteration, WireError):
            return still

    def _ask(self, asked: Asked, inbox: bytes, streams: list[str]) -> None:
        number = len(self._record.asked)
        self._record.asked.append(asked)
        self._hand(inbox)

        def missing() -> list[str]:
            come = {said.stream for said in self._record.said if said.after > number}
            return [stream for stream in streams if stream not in come]

        waited_for = set(streams) - self._given_up
        self._attention.waits(self._program, lambda: waited_for.isdisjoint(missing()), self._patience.answer_s)
        if not (unanswered := missing()):
            return
        self._record.unanswered[number] = unanswered
        if len(unanswered) == len(streams):
            self._stop(f"{asked}: nothing came on {listed(streams)}")
        self._given_up.update(unanswered)

    def _hand(self, inbox: bytes) -> None:
        self._inboxes += 1
        self._star.hand(inbox)

    def _spoil(self, how: str, tick: int) -> None:
        self._record.spoiled = len(self._record.said)
        further = messages.SenseInbox(
            k=tick,
            src=HUB,
            seq=self._inboxes + (how == "gap"),
            clock=tick,
            neighbours=[],
            measured=b"",
            position=None,
            motion=None,
            sighting=None,
        )
        whole = messages.pack(further)
        strange = msgspec.msgpack.encode({"k": tick, "src": HUB, "seq": self._inboxes, "phase": "rest"})
        self._star.hand({"garbage": b"\xc1" + whole, "no phase": strange, "gap": whole}[how])

    def _await_leaving(self) -> None:
        if self._attention.leaves(self._program, self._patience.answer_s):
            self._life.exit = self._program.child.process.returncode
            self._life.last_words = self._program.child.obituary()

    def _stop(self, why: str) -> None:
        program = self._program
        if self._life.failed is not None:
            raise Stopped(f"{why}; it failed: {self._life.failed}")
        if program.child.process.poll() is None:
            raise Stopped(f"{why}, and it {program.child.look()}")
        raise Stopped(f"{why}; {program.child.obituary()}")
