"""An agent of ours that notes when each broadcast arrives: what it heard, how long after it was said, in seconds.

Its command line ends with the file to write that to, a row of JSON for each message: src, channel, content tick, seconds.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

from agents.node import AgentBrief
from agents.real_time import RealTimeAgentsNode
from netem.processes.supervised import Supervisor
from netem.wire import messages
from netem.wire.carrier import Arrived, Session
from netem.wire.keys import Keys
from netem.wire.session import client


class Stamped:
    """An ear that notes when each message arrives."""

    def __init__(self, session: Session, key: str) -> None:
        self.came: list[tuple[float, Arrived]] = []
        self._next = 0
        session.hands(key, lambda arrived: self.came.append((time.monotonic(), arrived)))

    def next(self) -> Arrived:
        """The next message."""
        while self._next == len(self.came):
            time.sleep(0.001)
        self._next += 1
        return self.came[self._next - 1][1]

    def waiting(self) -> list[Arrived]:
        """All that has come since."""
        arrived = [one for _, one in self.came[self._next :]]
        self._next += len(arrived)
        return arrived


def heard(came: list[tuple[float, Arrived]]) -> list[list[Any]]:
    """Of each broadcast, who said it on which channel in which tick, and how many seconds later it arrived."""
    inboxes = [(at, messages.unpack_inbox(arrived.data)) for at, arrived in came]
    began = next(inbox.began for _, inbox in inboxes if isinstance(inbox, messages.SenseInbox))
    assert began is not None, "a run in real time"
    return [
        [said.src, said.channel, said.k, at - began - (said.at or 0.0)]
        for at, inbox in inboxes
        if isinstance(inbox, messages.ExchangeInbox)
        for said in inbox.messages
    ]


def main() -> None:
    """Fly as agents do, and write down what was heard."""
    supervisor = Supervisor()
    brief = supervisor.brief(AgentBrief)
    with supervisor.confessing(), Session(client(brief.login)) as session:
        node = RealTimeAgentsNode(session, supervisor, [brief])
        (mailbox,) = node._mailboxes.values()
        stamped: Any = Stamped(session, Keys(brief.run).inbox(brief.agent))
        mailbox._inbox = stamped
        node.await_everybody()
        supervisor.tell("ready")
        node.run()
        Path(sys.argv[1]).write_text("\n".join(map(json.dumps, heard(stamped.came))))
        supervisor.tell("done")


if __name__ == "__main__":
    main()
