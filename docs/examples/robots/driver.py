"""A driver made with a Zenoh client and a MessagePack codec alone, by docs/hardware.md, of simulated robots.

Put in place of `Robots` what your robots are: what is measured on each, and how one is told to fly.
"""

import json
import os
import random
import struct
import sys
import threading
import time

import msgpack
import zenoh

SIGMA, SEES = 0.05, 6.0  # m: how wrong measurements are, and how far robots see


class Robots:
    """Points that begin within a metre of where they should be, and fly what they are told."""

    def __init__(self, brief):
        self.neighbours, self.dt = brief["neighbours"], brief["dt"]
        self.chance = random.Random(brief["run"] if brief["factor"] else 1)
        self.places = [[x + self.chance.uniform(-1.0, 1.0) for x in place] for place in brief["nominal"]]
        self.flying = [[0.0] * len(place) for place in self.places]

    def fly(self, robot, velocity):
        """From now on it flies so."""
        self.flying[robot] = velocity

    def move(self):
        """A tick later."""
        for place, velocity in zip(self.places, self.flying, strict=True):
            place[:] = [x + self.dt * v for x, v in zip(place, velocity, strict=True)]

    def measured(self, robot):
        """The neighbours in sight, and where they are from this robot: their places less its own."""
        own, seen = self.places[robot], {}
        for neighbour in self.neighbours[robot]:
            away = [theirs - x for x, theirs in zip(own, self.places[neighbour - 1], strict=True)]
            if sum(x * x for x in away) <= SEES * SEES:
                seen[neighbour] = [x + self.chance.gauss(0.0, SIGMA) for x in away]
        return seen


def read(size):
    data = b""
    while len(data) < size:
        if not (chunk := os.read(0, size - len(data))):
            sys.exit("standard input closed before the brief was complete")
        data += chunk
    return data


def leave_with_the_launcher():
    while os.read(0, 4096):
        pass
    os._exit(1)


def floats(numbers):
    return struct.pack(f"<{len(numbers)}d", *numbers)


brief = msgpack.unpackb(read(*struct.unpack("<I", read(4))))
threading.Thread(target=leave_with_the_launcher, daemon=True).start()
login, robots = brief["login"], Robots(brief)
agents = range(1, len(brief["neighbours"]) + 1)
config = {
    "mode": "client",
    "id": login["name"].encode().hex(),
    "connect": {"endpoints": [login["endpoint"]], "timeout_ms": 10000, "retry": {"period_init_ms": 20}},
    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    "transport": {"auth": {"usrpwd": {"user": login["name"], "password": login["password"]}}},
}


def say(tick, number):
    for agent in agents:
        seen = robots.measured(agent - 1)
        measured = floats([x for away in seen.values() for x in away])
        said = {
            "agent": agent,
            "neighbours": [*seen],
            "measured": measured,
            "position": floats(robots.places[agent - 1]),
        }
        voices[agent].put(msgpack.packb({"k": tick, "src": "driver", "seq": number, **said}))


with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
    base = f"affinet/{brief['run']}/robot"
    commands = session.declare_subscriber(f"{base}/*/command", zenoh.handlers.FifoChannel(4 * len(agents)))
    voices = {agent: session.declare_publisher(f"{base}/{agent}/measured") for agent in agents}
    for voice in voices.values():  # what is said before anybody hears is lost
        changes = voice.declare_matching_listener(zenoh.handlers.FifoChannel(4))
        while not voice.matching_status.matching:
            changes.recv()
    print('{"event": "ready"}', flush=True)
    say(0, 0)
    number, tick, is_over = 1, -1, False
    while not is_over:
        heard = [commands.recv() for _ in agents]  # one for each robot in a tick
        for command in (msgpack.unpackb(sample.payload.to_bytes()) for sample in heard):
            tick, is_over = command["k"], command["last"]
            robots.fly(command["agent"] - 1, struct.unpack(f"<{len(command['input']) // 8}d", command["input"]))
        if not is_over:
            if brief["factor"]:  # in real time a tick lasts, and what is said as it ends is in time for the next
                time.sleep(0.8 * brief["dt"] / brief["factor"])
            robots.move()
            say(tick + 1, number)
            number += 1
print('{"event": "done"}', flush=True)
