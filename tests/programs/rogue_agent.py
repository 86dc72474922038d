"""An agent that flies as it should, and on the side listens to everything and speaks in everybody's name."""

import json
import sys

import zenoh

from agents.node import AgentBrief, AgentsNode
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session
from netem.wire.keys import Keys
from netem.wire.session import client

PEERS = range(1, 11)


def main() -> None:
    supervisor = Supervisor()
    brief = supervisor.brief(AgentBrief)
    keys = Keys(brief.run)
    with Session(client(brief.login)) as session:
        side = session._session
        node = AgentsNode(session, supervisor, [brief])
        overheard = side.declare_subscriber("**", zenoh.handlers.FifoChannel(100_000))
        private = [key for peer in PEERS for key in (keys.inbox(peer), keys.told(peer))]
        inboxes = [side.declare_subscriber(key, zenoh.handlers.FifoChannel(10_000)) for key in private]
        node.await_everybody()
        supervisor.tell("ready")
        lies = 0
        for peer in PEERS:
            if peer == brief.agent:
                continue
            spoken = [keys.broadcast(peer, channel) for channel in ("input", "measurement")]
            for key in (*spoken, keys.act(peer), keys.inbox(peer), keys.told(peer)):
                for _ in range(20):
                    side.put(key, b"a lie", allowed_destination=zenoh.Locality.REMOTE)
                    lies += 1
        for key in (keys.sense, keys.journal, keys.broadcast("*", "*"), keys.act("*")):
            side.put(key, b"a lie", allowed_destination=zenoh.Locality.REMOTE)
            side.delete(key, allowed_destination=zenoh.Locality.REMOTE)
        node.run()
        supervisor.tell("done")
        heard = set()
        said = [keys.act(brief.agent), *(keys.broadcast(brief.agent, channel) for channel in ("input", "measurement"))]
        for subscriber in (overheard, *inboxes):
            while (sample := subscriber.try_recv()) is not None:
                if str(sample.key_expr) not in said:  # a session hears itself, without the hub
                    heard.add(str(sample.key_expr).removeprefix(f"affinet/{brief.run}/"))
        with open(sys.argv[1], "w") as file:
            json.dump({"heard": sorted(heard), "lies": lies}, file)


if __name__ == "__main__":
    main()
