"""An agent that flies as it should, but for what it says besides on its own keys in one tick, before what it should say.

Names of mistakes (`hostile.catalogue`) to make are its arguments, "all" for all of them; "floods" for very many of one;
"deaf" for an agent that reads no more.
"""

import sys
import time
from pathlib import Path

import msgpack
import zenoh

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from hostile import catalogue

from agents.node import AgentBrief, AgentsNode
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session
from netem.wire.session import client

TICK = 4
FLOOD = 200_000


class Speaking:
    """A voice that says what it should, and something else before that."""

    def __init__(self, session: Session, voice, on: str, wanted: list[str]) -> None:
        self._mistakes = [one for one in catalogue() if one.on == on and (wanted == ["all"] or str(one) in wanted)]
        self._floods = on == "input" and wanted == ["floods"]
        # What is said here is not to be lost on the way because the way is busy.
        self._voice = session._session.declare_publisher(
            voice.publisher.key_expr, congestion_control=zenoh.CongestionControl.BLOCK
        )
        self.await_heard = voice.await_heard

    def say(self, data: bytes) -> None:
        said = msgpack.unpackb(data)
        if said["k"] == TICK:
            for mistake in self._mistakes:
                self._voice.put(mistake.made(said))
            if self._floods:
                for _ in range(FLOOD):
                    self._voice.put(b"\xc1" * 100)
        self._voice.put(data)


class Deaf(AgentsNode):
    """Reads no more, and answers no more."""

    def _speak(self, tick, *given):
        if tick == TICK:
            time.sleep(3600)
        return super()._speak(tick, *given)


def main() -> None:
    supervisor = Supervisor()
    brief = supervisor.brief(AgentBrief)
    wanted = sys.argv[1:]
    with Session(client(brief.login)) as session:
        node = (Deaf if wanted == ["deaf"] else AgentsNode)(session, supervisor, [brief])
        for mailbox in node._mailboxes.values():
            mailbox._act = Speaking(session, mailbox._act, "act", wanted)
            mailbox._broadcasts = {
                channel: Speaking(session, voice, channel, wanted) for channel, voice in mailbox._broadcasts.items()
            }
        node.await_everybody()
        supervisor.tell("ready")
        with supervisor.confessing():
            node.run()
        supervisor.tell("done")


if __name__ == "__main__":
    main()
