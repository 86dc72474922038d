"""What one agent hears and says: keys of its own, and numbers of its own on each of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from netem.core import channels
from netem.wire import messages
from netem.wire.carrier import Arrived, Session, Voice
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering, Sequences
from netem.wire.wrong import WireError, Wrong

_WAITING = 4096  # messages that may wait


class Inboxes:
    """Reads what the medium tells an agent: what it sensed, what was exchanged in the same tick, and so on, until the end.

    Parameters
    ----------
    agent, neighbours
        Whose they are, and the numbers of the agents in its neighbour slots.
    lost
        In real time, where exchanges come as messages do, and it may begin with any inbox: told how many are missing.
    """

    def __init__(
        self, agent: int, neighbours: tuple[int, ...], *, lost: Callable[[str, int], None] | None = None
    ) -> None:
        self._whose, self._neighbours = f"agent {agent}: its inbox", frozenset(neighbours)
        self._in_real_time = lost is not None
        self._numbers = Sequences("the medium's", from_any=self._in_real_time, lost=lost)
        self._tick, self._sensed = -1, False

    def read(self, data: bytes) -> messages.Inbox:
        """What came.

        Raises
        ------
        WireError
            When it is no inbox, or not the one that is due, or of others than its neighbours.
        UninstructedLoss
            When one before it is missing.
        """
        inbox = messages.unpack_inbox(data)
        self._numbers.check("inbox", inbox.seq)
        match inbox:
            case messages.SenseInbox():
                due = inbox.k > self._tick and (self._in_real_time or not self._sensed)
                whom = inbox.neighbours
            case messages.ExchangeInbox():
                at_its_time = inbox.k >= self._tick if self._in_real_time else self._sensed and inbox.k == self._tick
                due, whom = at_its_time, [said.src for said in inbox.messages]
            case messages.EndInbox():
                return inbox
        if not due:
            wrong = Wrong.PAST if inbox.k < self._tick else Wrong.FUTURE if inbox.k > self._tick else Wrong.REPEATED
            raise WireError(f"{self._whose}: it is of tick {inbox.k}, after one of tick {self._tick}", wrong)
        if isinstance(inbox, messages.ExchangeInbox) and any(not 0 <= said.k <= inbox.k for said in inbox.messages):
            raise WireError(f"{self._whose}: it has what is said in a future tick, or in none", Wrong.FUTURE)
        if not self._neighbours.issuperset(whom):
            strangers = sorted({*whom} - self._neighbours)
            raise WireError(f"{self._whose}: it has no neighbours {strangers} (see docs/protocol.md)", Wrong.SHAPE)
        self._sensed = isinstance(inbox, messages.SenseInbox)
        if self._sensed or not self._in_real_time:
            self._tick = inbox.k
        return inbox


class Mailbox:
    """An agent's place on the network.

    Parameters
    ----------
    session, run
        Where, and in which run.
    agent, neighbours
        Its number, and the numbers of the agents in its neighbour slots.
    spoken
        The channels on which it broadcasts arrays; measurements are broadcast too.
    hears_centre
        Whether a centre tells it its edges.
    lost
        In real time, where nobody waits for it, and it may miss what the medium tells it: told on which key, and how much.
    """

    def __init__(
        self,
        session: Session,
        run: str,
        agent: int,
        neighbours: tuple[int, ...],
        spoken: list[str],
        *,
        hears_centre: bool,
        lost: Callable[[str, int], None] | None = None,
    ) -> None:
        keys = Keys(run)
        self.agent, self.neighbours = agent, neighbours
        self._lost = lost and (lambda _, number: lost(keys.inbox(agent), number))
        self.begin()
        self._inbox = session.hears(keys.inbox(agent), _WAITING)
        self._told = session.hears(keys.told(agent), _WAITING) if hears_centre else None
        self._broadcasts = {name: session.says(keys.broadcast(agent, name)) for name in (channels.MEASUREMENT, *spoken)}
        self._act = session.says(keys.act(agent))

    def begin(self) -> None:
        """Nothing was said or heard: the agent is new."""
        self.heard = 0
        self._numbers = Numbering()
        self._inboxes = Inboxes(self.agent, self.neighbours, lost=self._lost)
        self._tellings = Sequences("the centre's")

    @property
    def voices(self) -> list[Voice]:
        """All it speaks with."""
        return [*self._broadcasts.values(), self._act]

    def next_inbox(self) -> messages.Inbox:
        """Wait for what the medium delivers.

        Raises
        ------
        WireError
            When it is no inbox, or not the one that is due, or of others than its neighbours.
        UninstructedLoss
            When one before it is missing.
        """
        return self._read(self._inbox.next())

    def waiting_inboxes(self) -> list[messages.Inbox]:
        """All that the medium has delivered by now.

        Raises
        ------
        WireError, UninstructedLoss
            As of `next_inbox`.
        """
        return [self._read(arrived) for arrived in self._inbox.waiting()]

    def _read(self, arrived: Arrived) -> messages.Inbox:
        inbox = self._inboxes.read(arrived.data)
        if isinstance(inbox, messages.ExchangeInbox):
            self.heard += len(inbox.messages)
        return inbox

    def next_told(self) -> messages.Told:
        """Wait for what the centre tells.

        Raises
        ------
        WireError
            When it is something else.
        UninstructedLoss
            When something before it is missing.
        """
        assert self._told is not None, "it hears no centre"
        told = messages.unpack(messages.Told, self._told.next().data)
        self._tellings.check("told", told.seq)
        return told

    def broadcast(self, tick: int, channel: str, payload: dict[str, Any], at: float | None) -> None:
        """Tell the neighbours, and in real time when this is said, in simulated seconds."""
        seq = self._numbers.next(channel)
        said = messages.Broadcast(k=tick, src=self.agent, channel=channel, seq=seq, payload=payload, at=at)
        self._broadcasts[channel].say(messages.pack(said))

    def act(self, tick: int, **said: Any) -> None:
        """Tell the world what it does, and believes."""
        act = messages.Act(k=tick, src=self.agent, seq=self._numbers.next("act"), heard=self.heard, **said)
        self._act.say(messages.pack(act))
