"""A driver whose robots are the simulated world of a scenario, and that does one thing wrong if it is told to.

    driver.py SCENARIO OVERRIDES [WRONG]

OVERRIDES are those of the scenario as a JSON list; WRONG is what robot 2 says in tick 3, or what it or the driver does then.
"""

import json
import os
import sys
from dataclasses import replace

import msgpack
import numpy as np

from affinet.planning import making
from affinet.scenario import loading
from netem.faults.timeline import Timeline
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session, await_heard
from netem.wire.keys import Keys
from netem.wire.session import client
from world.brief import DriverBrief

NUMBER, TICK = 2, 3
BIG = 1 << 21


def wronged(said, wrong):
    """What is put on the wire in place of what should be."""
    measured = np.frombuffer(said["measured"])
    by_name = {
        "malformed": lambda: b"\xc1",
        "oversized": lambda: said | {"measured": bytes(BIG)},
        "a field too much": lambda: said | {"battery": 0.7},
        "spoofed": lambda: said | {"agent": 3},
        "in another's name": lambda: said | {"src": "world"},
        "past": lambda: said | {"k": said["k"] - 1},
        "future": lambda: said | {"k": said["k"] + 1},
        "repeated": lambda: said | {"seq": said["seq"] - 1},
        "skipped": lambda: said | {"seq": said["seq"] + 1},
        "a stranger": lambda: said | {"neighbours": [99, *said["neighbours"][1:]]},
        "twice the same": lambda: said | {"neighbours": said["neighbours"][:1] * len(said["neighbours"])},
        "too short": lambda: said | {"measured": said["measured"][:-8]},
        "not a number": lambda: said | {"measured": np.full_like(measured, np.nan).tobytes()},
        "infinite": lambda: said | {"position": np.array([np.inf, 0.0]).tobytes()},
        "no position": lambda: said | {"position": None},
    }
    made = by_name.get(wrong, lambda: said)()
    return made if isinstance(made, bytes) else msgpack.packb(made)


class Driver:
    """Says what the world senses, and flies what is commanded."""

    def __init__(self, session, brief, world, wrong):
        keys = Keys(brief.run)
        self.world, self.wrong, self.dimension = world, wrong, world.formation.dimension
        self.calm = Timeline(world.links, []).at(0)
        self.agents = range(1, world.links.agents + 1)
        self.ear = session.hears(keys.command("*"), 4 * len(self.agents))
        self.voices = {agent: session.says(keys.measured(agent)) for agent in self.agents}
        await_heard(self.voices.values())

    def say(self, tick, measured, position):
        for agent in self.agents:
            rows = np.flatnonzero(self.world.links.dst == agent)
            said = {
                "k": tick,
                "src": "driver",
                "seq": tick,
                "agent": agent,
                "neighbours": self.world.links.src[rows].tolist(),
                "measured": (-measured[rows]).tobytes(),
                "position": position[agent - 1].tobytes(),
            }
            if self.wrong == "nobody but leaders says where it is" and agent > 3:
                said["position"] = None
            if self.wrong == "stuck":
                said["k"] = min(tick, TICK - 1)
            strikes = self.wrong and (agent, tick) == (NUMBER, TICK)
            if self.wrong == "robot 2 is quiet" and agent == NUMBER and tick >= TICK:
                continue
            if strikes and self.wrong == "dies":
                os._exit(3)
            if strikes and self.wrong == "quiet":
                self.ear.next = lambda: sys.stdin.buffer.read() and None  # until its lifeline closes
                return
            if strikes and self.wrong == "two at once":
                self.voices[agent].say(msgpack.packb(said))
                said |= {"seq": tick + 1}
            self.voices[agent].say(wronged(said, self.wrong) if strikes else msgpack.packb(said))

    def commanded(self):
        said = [msgpack.unpackb(self.ear.next().data) for _ in self.agents]
        said.sort(key=lambda command: command["agent"])
        return said[0]["k"], np.array([np.frombuffer(one["input"]) for one in said]), said[0]["last"]

    def fly(self):
        scene = self.world.begin()
        tick, is_over = 0, False
        while not is_over:
            measured = self.world.measure(tick, scene, self.calm)
            self.say(tick, measured, scene.position)
            told, flown, is_over = self.commanded()
            assert told == tick, f"told to fly tick {told} in tick {tick}"
            scene = self.world.step(tick, scene, measured, flown, self.calm)
            tick += 1


def main():
    """Fly until the run is over."""
    scenario, overrides, *wrong = sys.argv[1:]
    supervisor = Supervisor()
    brief = supervisor.brief(DriverBrief)
    world = making.make(loading.load(scenario, json.loads(overrides))).world
    with supervisor.confessing(), Session(client(brief.login)) as session:
        driver = Driver(session, brief, replace(world, ticks=world.ticks + 1), wrong[0] if wrong else None)
        supervisor.tell("ready")
        driver.fly()
    supervisor.tell("done")


if __name__ == "__main__":
    main()
