"""An agent that flies as it should, but that it takes its time, or for one thing that it does wrong, if it is agent 2."""

import os
import sys
import threading
import time

from agents.node import AgentBrief, AgentsNode
from agents.real_time import RealTimeAgentsNode
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session
from netem.wire.session import client

TICK = 4


class Wayward:
    def __init__(self, session, supervisor, brief, wrong):
        super().__init__(session, supervisor, [brief])
        self.wrong = wrong
        (self.mailbox,) = self._mailboxes.values()

    def _tell(self, tick, action, awake, punctuality=None):
        if self.wrong == "thinks":
            time.sleep(0.1)
        if tick == TICK:
            match self.wrong:
                case "loses":
                    self.mailbox.heard -= 1
                case "skips":
                    self.mailbox._numbers.next("act")
                case "hangs":
                    threading.Event().wait()
                case "prints":
                    os.write(self._supervisor._events, b'{"event":"kill","agents":[1]}\n')
        super()._tell(tick, action, awake, punctuality)


class InLockstep(Wayward, AgentsNode):
    pass


class InRealTime(Wayward, RealTimeAgentsNode):
    pass


def main() -> None:
    supervisor = Supervisor()
    brief = supervisor.brief(AgentBrief)
    wrong = sys.argv[1] if brief.agent == 2 or sys.argv[1] == "thinks" else ""
    with Session(client(brief.login)) as session:
        node = (InLockstep if brief.timer is None else InRealTime)(session, supervisor, brief, wrong)
        node.await_everybody()
        supervisor.tell("ready")
        with supervisor.confessing():
            node.run()
        supervisor.tell("done")
    if wrong == "leaves":
        sys.exit("it did not want to leave")


if __name__ == "__main__":
    main()
