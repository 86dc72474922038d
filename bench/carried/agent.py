"""An agent of ours that notes what it hears and says: which message in which inbox, what is in it, and how long it took.

Its command line ends with the file to write that to (`carried.journals.Noted`).
"""

from __future__ import annotations

import queue
import sys
import time
import zlib
from typing import Any

import msgspec
import numpy as np

from agents.node import AgentBrief
from agents.process import node_of
from netem.core import channels
from netem.processes.supervised import Supervisor
from netem.wire import messages
from netem.wire.carrier import Arrived, Session
from netem.wire.keys import Keys
from netem.wire.session import client


class Noting:
    """An ear that notes when each message arrives."""

    def __init__(self, session: Session, key: str) -> None:
        self.came: list[tuple[float, Arrived]] = []
        self._waiting: queue.SimpleQueue[Arrived] = queue.SimpleQueue()
        session.hands(key, self._take)

    def _take(self, arrived: Arrived) -> None:
        self.came.append((time.monotonic(), arrived))
        self._waiting.put(arrived)

    def next(self) -> Arrived:
        """The next message."""
        return self._waiting.get()

    def waiting(self) -> list[Arrived]:
        """All that has come since."""
        return [self._waiting.get() for _ in range(self._waiting.qsize())]


def heard(came: list[tuple[float, Arrived]]) -> tuple[list[list[int]], list[float]]:
    """Of each message: the tick of its inbox, that of which it speaks, channel, who said it, and what; and seconds it took."""
    rows, took, began = [], [], None
    for at, arrived in came:
        inbox = messages.unpack_inbox(arrived.data)
        if isinstance(inbox, messages.SenseInbox):
            began = inbox.began if began is None else began
            rows += [[inbox.k, inbox.k, channels.code(channels.SENSE), src, 0] for src in inbox.neighbours]
            took += [np.nan] * len(inbox.neighbours)
        elif isinstance(inbox, messages.ExchangeInbox):
            for said in inbox.messages:
                rows.append([inbox.k, said.k, channels.code(said.channel), said.src, digest(said.payload)])
                took.append(np.nan if began is None or said.at is None else at - began - said.at)
    return rows, took


def digest(payload: Any) -> int:
    """Of what is in a message."""
    return zlib.crc32(msgspec.msgpack.encode(sorted(payload.items())))


def noting_what_it_says(mailbox: Any) -> list[list[int]]:
    """Of each broadcast from now on: its tick, channel, what is said, and whether there is any number in it."""
    rows: list[list[int]] = []
    broadcast = mailbox.broadcast

    def noted(tick: int, channel: str, payload: dict[str, Any], at: float | None) -> None:
        rows.append([tick, channels.code(channel), digest(payload), any(map(len, payload.values()))])
        broadcast(tick, channel, payload, at)

    mailbox.broadcast = noted
    return rows


def main() -> None:
    """Fly as agents do, and write down what was heard and said."""
    supervisor = Supervisor()
    brief = supervisor.brief(AgentBrief)
    with supervisor.confessing(), Session(client(brief.login)) as session:
        node = node_of(session, supervisor, [brief], None)
        (mailbox,) = node._mailboxes.values()
        ear: Any = Noting(session, Keys(brief.run).inbox(brief.agent))
        mailbox._inbox._subscriber.undeclare()  # what nobody takes from it would hold up what comes after
        mailbox._inbox = ear
        said = noting_what_it_says(mailbox)
        node.await_everybody()
        supervisor.tell("ready")
        node.run()
        rows, took = heard(ear.came)
        with open(sys.argv[1], "wb") as file:
            np.savez(
                file, heard=np.array(rows).reshape(-1, 5), took_s=np.array(took), said=np.array(said).reshape(-1, 4)
            )
        supervisor.tell("done")


if __name__ == "__main__":
    main()
