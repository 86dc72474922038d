"""What came of a flight against one agent: what it was asked, what it said, and what its processes told. Checks read it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple

import msgspec

from affinet.planning.plan import Plan
from analysis.models.arrays import Array

Phase = Literal["sense", "exchange"]
ACT = "act"


class Handed(NamedTuple):
    """A broadcast that was in an inbox."""

    tick: int
    agent: int
    channel: str


class Asked(NamedTuple):
    """An inbox that was to be answered.

    Parameters
    ----------
    tick, phase
        Of the run.
    life
        Which of its processes got it, from 0.
    clock
        What its clock said.
    handed
        The broadcasts in it.
    flying
        The input of its body in this tick, shape (D,), which a sense inbox asks for.
    """

    tick: int
    phase: Phase
    life: int
    clock: int
    handed: tuple[Handed, ...] = ()
    flying: Array | None = None

    def __str__(self) -> str:
        return f"tick {self.tick}, {self.phase}"


class Said(NamedTuple):
    """Something that the agent published.

    Parameters
    ----------
    life, after
        Which of its processes there was, and how many inboxes had gone out by then.
    stream
        The channel, or `act`.
    data
        As it came.
    """

    life: int
    after: int
    stream: str
    data: bytes

    @property
    def fields(self) -> dict[Any, Any]:
        """What it says, whatever that is; nothing where it is no map."""
        try:
            plain = msgspec.msgpack.decode(self.data)
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
            return {}
        return plain if isinstance(plain, dict) else {}


class Answer(NamedTuple):
    """Something that it published, and the inbox that this answers."""

    asked: Asked
    stream: str
    said: Said


@dataclass
class Life:
    """One process of the agent.

    Parameters
    ----------
    ready, done
        Whether it said so.
    failed
        Why it says that it fails, if it does.
    wrong
        What it told that no agent may, in words.
    exit
        Its exit status, minus the signal that ended it; None where it did not leave.
    last_words
        How it left, and the end of its log.
    """

    ready: bool = False
    done: bool = False
    failed: str | None = None
    wrong: list[str] = field(default_factory=list)
    exit: int | None = None
    last_words: str = ""


@dataclass
class Record:
    """A flight.

    Parameters
    ----------
    plan, agent
        What was flown, and who of it was under test.
    lives
        Its processes, in order.
    asked, said
        The inboxes to be answered, and what was published, in order.
    unanswered
        For each inbox that was not answered whole, the streams on which nothing came in time.
    spoiled
        How many messages had come when it was handed what is no inbox.
    stopped
        Why the flight did not get as far as it should, in words.
    """

    plan: Plan
    agent: int
    lives: list[Life] = field(default_factory=list)
    asked: list[Asked] = field(default_factory=list)
    said: list[Said] = field(default_factory=list)
    unanswered: dict[int, list[str]] = field(default_factory=dict)
    spoiled: int | None = None
    stopped: str | None = None

    @property
    def channels(self) -> list[str]:
        """On which it has to broadcast."""
        return list(self.plan.channels[1:])

    @cached_property
    def answers(self) -> list[Answer]:
        """What it published, each with the inbox before it that is answered on this stream, or the first of its process."""
        return [Answer(asked, said.stream, said) for said in self.said if (asked := self._answered_by(said))]

    def to(self, asked: Asked, stream: str) -> list[Said]:
        """What answers an inbox on a stream."""
        return [answer.said for answer in self.answers if answer.asked is asked and answer.stream == stream]

    def _answered_by(self, said: Said) -> Asked | None:
        phase: Phase = "exchange" if said.stream == ACT else "sense"
        own = [
            (sent, asked) for sent, asked in enumerate(self.asked) if (asked.life, asked.phase) == (said.life, phase)
        ]
        before = [asked for sent, asked in own if sent < said.after]
        return before[-1] if before else next((asked for _, asked in own), None)
