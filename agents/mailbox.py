"""What one agent hears and says: keys of its own, and numbers of its own on each of them."""

from __future__ import annotations

from typing import Any

from netem.core import channels
from netem.wire import messages
from netem.wire.arrays import WireError
from netem.wire.carrier import Arrived, Session, Voice
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering, Sequences
from netem.wire.session import LARGEST

_WAITING = 4096  # messages that may wait


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
    joins_late
        Whether it may miss what the medium tells it at first: in real time nobody waits for it to listen.
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
        joins_late: bool = False,
    ) -> None:
        keys = Keys(run)
        self.agent, self.neighbours, self._joins_late = agent, neighbours, joins_late
        self.begin()
        self._inbox = session.hears(keys.inbox(agent), _WAITING)
        self._told = session.hears(keys.told(agent), _WAITING) if hears_centre else None
        self._broadcasts = {name: session.says(keys.broadcast(agent, name)) for name in (channels.MEASUREMENT, *spoken)}
        self._act = session.says(keys.act(agent))

    def begin(self) -> None:
        """Nothing was said or heard: the agent is new."""
        self.heard = 0
        self._numbers = Numbering()
        self._inboxes = Sequences("the medium's", from_any=self._joins_late)
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
            When it is no inbox.
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
        inbox = messages.unpack_inbox(arrived.data)
        self._inboxes.check("inbox", inbox.seq)
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
        self._say(self._broadcasts[channel], repr(channel), messages.pack(said))

    def act(self, tick: int, **said: Any) -> None:
        """Tell the world what it does, and believes."""
        act = messages.Act(k=tick, src=self.agent, seq=self._numbers.next("act"), heard=self.heard, **said)
        self._say(self._act, "'act'", messages.pack(act))

    def _say(self, voice: Voice, key: str, data: bytes) -> None:
        if len(data) > LARGEST:
            raise WireError(
                f"agent {self.agent} says {len(data)} bytes on {key}, and nobody hears more than {LARGEST} at once: "
                "have its estimator say or report less"
            )
        voice.say(data)
