"""An agent that flies as it should, but that it takes its time, or for one thing that it does wrong, if it is agent 2."""

import os
import sys
import time

from msgspec.structs import replace

from agents.process import AgentBrief, AgentNode
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session
from netem.wire.session import client

TICK = 4


class Wayward(AgentNode):
    def __init__(self, session, supervisor, brief, wrong):
        super().__init__(session, supervisor, brief)
        self.wrong = wrong

    def _exchange(self, inbox, sensed):
        if self.wrong == "thinks":
            time.sleep(0.1)
        if inbox.k == TICK:
            match self.wrong:
                case "loses":
                    inbox = replace(inbox, messages=inbox.messages[1:])
                case "skips":
                    self._numbers.next("act")
                case "prints":
                    os.write(self._supervisor._events, b'{"event":"kill","agents":[1]}\n')
        super()._exchange(inbox, sensed)


def main() -> None:
    supervisor = Supervisor()
    brief = supervisor.brief(AgentBrief)
    wrong = sys.argv[1] if brief.agent == 2 or sys.argv[1] == "thinks" else ""
    with Session(client(brief.login)) as session:
        node = Wayward(session, supervisor, brief, wrong)
        node.await_everybody()
        supervisor.tell("ready")
        with supervisor.confessing():
            node.run()
        supervisor.tell("done")
    if wrong == "leaves":
        sys.exit("it did not want to leave")


if __name__ == "__main__":
    main()
