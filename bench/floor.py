"""One process of the floor: the messages of a tick through bare Zenoh, nobody computes (`lockstep.py` starts these)."""

from __future__ import annotations

import json
import sys
import time

import zenoh

from netem.wire.carrier import Voice
from netem.wire.keys import Keys
from netem.wire.session import HUB, WORLD, Login, client, hub

CHANNELS = ("input", "measurement", "theta")
FIFO = zenoh.handlers.FifoChannel


def be_hub(session: zenoh.Session, keys: Keys, agents: int, ticks: int, size: dict[str, int]) -> None:
    """Relay as the medium does."""
    sense = session.declare_subscriber(keys.sense, FIFO(64))
    said = session.declare_subscriber(keys.broadcast("*", "*"), FIFO(4096))
    inboxes = [session.declare_publisher(keys.inbox(agent)) for agent in range(1, agents + 1)]
    journal = session.declare_publisher(keys.journal)
    ready([*inboxes, journal])
    for _ in range(ticks):
        sense.recv().payload.to_bytes()
        for inbox in inboxes:
            inbox.put(b"." * size["seen"])
        journal.put(b"." * size["journal"])
        for _ in range(agents * len(CHANNELS)):
            said.recv().payload.to_bytes()
        for inbox in inboxes:
            inbox.put(b"." * size["heard"])
    sys.stdin.readline()


def be_world(session: zenoh.Session, keys: Keys, agents: int, ticks: int, size: dict[str, int]) -> None:
    """Sense, and wait for everybody; prints the seconds of a tick."""
    acts = session.declare_subscriber(keys.act("*"), FIFO(4096))
    journal = session.declare_subscriber(keys.journal, FIFO(64))
    sense = session.declare_publisher(keys.sense)
    ready([sense])
    began = time.perf_counter()
    for _ in range(ticks):
        sense.put(b"." * size["sense"])
        journal.recv().payload.to_bytes()
        for _ in range(agents):
            acts.recv().payload.to_bytes()
    print((time.perf_counter() - began) / ticks, flush=True)
    sys.stdin.readline()


def be_agent(session: zenoh.Session, keys: Keys, agent: int, ticks: int, size: dict[str, int]) -> None:
    """Answer."""
    inbox = session.declare_subscriber(keys.inbox(agent), FIFO(64))
    said = [session.declare_publisher(keys.broadcast(agent, name)) for name in CHANNELS]
    act = session.declare_publisher(keys.act(agent))
    ready([*said, act])
    for _ in range(ticks):
        inbox.recv().payload.to_bytes()
        for broadcast in said:
            broadcast.put(b"." * size["said"])
        inbox.recv().payload.to_bytes()
        act.put(b"." * size["act"])
    sys.stdin.readline()


def ready(publishers: list[zenoh.Publisher]) -> None:
    """Say so, and wait for the word to begin."""
    for publisher in publishers:
        Voice(publisher).await_heard()
    print("ready", flush=True)
    sys.stdin.readline()


def main() -> None:
    """Be the role that standard input names."""
    told = json.loads(sys.stdin.readline())
    role, agents, ticks, size = told["role"], told["agents"], told["ticks"], told["size"]
    keys, login = Keys("floor"), Login(*told["login"])
    config = hub(login, told["users"], keys, range(1, agents + 1), {}) if role == HUB else client(login)
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        if role == HUB:
            be_hub(session, keys, agents, ticks, size)
        elif role == WORLD:
            be_world(session, keys, agents, ticks, size)
        else:
            be_agent(session, keys, int(role), ticks, size)


if __name__ == "__main__":
    main()
