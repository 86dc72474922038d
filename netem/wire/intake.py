"""What becomes of a wrong message, for every subscriber of a run: it is refused, counted and named, and may end the run.

Who speaks is known by the key, which access control leaves to one sender, before anything is unpacked. What is wrong with a
message its reader says (`WireError`); sizes and numbers are looked at here, before a reader sees it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, TypeVar

from netem.wire.sequence import UninstructedLoss
from netem.wire.wrong import WireError, Wrong

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
Policy = Literal["fail", "drop"]


@dataclass(frozen=True)
class Trust:
    """What is taken from agents.

    Parameters
    ----------
    wrong_messages
        Whether a wrong message fails the run, or is dropped while the right one is waited for.
    largest_message
        In bytes.
    messages_per_tick
        How many messages of an agent a subscriber looks at in a tick.
    foreign
        Agents that are flown by programs of somebody else's: what these compute nobody has checked.
    """

    wrong_messages: Policy
    largest_message: int
    messages_per_tick: int
    foreign: frozenset[int]


class Refusals(NamedTuple):
    """How many messages of an agent a subscriber has refused by one mistake; `agent` is None of who holds the control login."""

    agent: int | None
    wrong: Wrong
    number: int


class Came(Protocol):
    """A message as it came."""

    @property
    def key(self) -> str:
        """On which key."""

    @property
    def size(self) -> int:
        """How many bytes there are."""

    @property
    def data(self) -> bytes:
        """The bytes."""


class Reader(Protocol[T_co]):
    """Reads the messages of one kind."""

    def speaker(self, key: str) -> int:
        """Whose key it is."""

    def read(self, key: str, data: bytes, tick: int, awaited: Container[Any]) -> T_co:
        """What came in a tick in which so much is awaited; a `WireError` or an `UninstructedLoss` where it is wrong."""

    def refuse(self, key: str) -> None:
        """Take note that what came there last was refused, for another reason than its number."""


class Intake:
    """What a subscriber takes from agents.

    Parameters
    ----------
    trust
        What is taken.
    """

    def __init__(self, trust: Trust) -> None:
        self._trust = trust
        self._tick = -1
        self._came: dict[int, int] = {}
        self._refused: Counter[tuple[int | None, Wrong]] = Counter()

    @property
    def refused(self) -> list[Refusals]:
        """What was refused so far; may be asked from another thread."""
        return [Refusals(*what, count) for what, count in tuple(self._refused.items())]

    def note(self, agent: int | None, wrong: Wrong, count: int = 1) -> None:
        """Count what is wrong, and no reason to refuse anything."""
        self._refused[agent, wrong] += count

    def take(self, arrived: Came, tick: int, awaited: Container[Any], reader: Reader[T]) -> T | None:
        """What came, as it is read; None where it is wrong, and is dropped.

        Parameters
        ----------
        arrived
            As it came.
        tick, awaited
            In which the subscriber is, and what is to come.
        reader
            Who reads it.

        Raises
        ------
        WireError, UninstructedLoss
            When it is wrong, and that fails the run.
        """
        key = arrived.key
        agent = reader.speaker(key)
        try:
            self._admit(agent, key, arrived.size, tick)
            return reader.read(key, arrived.data, tick, awaited)
        except (WireError, UninstructedLoss) as error:
            self.note(agent, error.wrong)
            if isinstance(error, WireError):
                reader.refuse(key)
            if self._trust.wrong_messages == "fail":
                raise
            return None

    def _admit(self, agent: int, key: str, size: int, tick: int) -> None:
        if tick != self._tick:
            self._tick = tick
            self._came.clear()
        self._came[agent] = came = self._came.get(agent, 0) + 1
        trust = self._trust
        if came > trust.messages_per_tick:
            says = f"more than {trust.messages_per_tick} messages in tick {tick} (trust.messages_per_tick)"
            raise WireError(f"agent {agent}: {says}", Wrong.FLOOD)
        if size > trust.largest_message:
            says = f"{size} bytes on {key!r}, at most {trust.largest_message} are taken (trust.largest_message)"
            raise WireError(f"agent {agent}: {says}", Wrong.OVERSIZED)
