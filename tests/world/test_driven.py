"""What is heard of robots outside in real time: the newest of each link, and how far behind the driver is."""

from types import SimpleNamespace

import msgpack
import numpy as np
import pytest
from flying import plan_of

from netem.core.pace import Pace
from netem.faults.timeline import Timeline
from netem.wire.intake import Intake, Trust
from netem.wire.keys import Keys
from world.driven import DrivenWorld
from world.real_time import TooLate

PLAN = plan_of("corridor", "time.duration=0.5")
WORLD, KEYS = PLAN.world, Keys("run")
CALM = Timeline(WORLD.links, []).at(0)
AGENTS = range(1, WORLD.links.agents + 1)


class Air:
    """A session in which robots say what a test has them say."""

    def __init__(self):
        self.said, self.commands, self.numbers = [], [], dict.fromkeys(AGENTS, 0)

    def robot(self, agent, k, measured=(), position=(1.0, 2.0)):
        said = {
            "k": k,
            "src": "driver",
            "seq": self.numbers[agent],
            "agent": agent,
            "neighbours": [n for n, _ in measured],
        }
        self.numbers[agent] += 1
        arrays = {
            "measured": np.array([away for _, away in measured]).tobytes(),
            "position": np.array(position).tobytes(),
        }
        data = msgpack.packb(said | arrays)
        self.said.append(SimpleNamespace(key=KEYS.measured(agent), size=len(data), data=data))

    def robots(self, k):
        for agent in AGENTS:
            self.robot(agent, k)

    def hears_anybody(self, _key, _room):
        def waiting():
            said, self.said = self.said, []
            return said

        return SimpleNamespace(next=lambda: self.said.pop(0), waiting=waiting)

    def says(self, _key):
        return SimpleNamespace(say=self.commands.append)


def begun(late=1.0):
    air, kept = Air(), []
    brief = SimpleNamespace(
        run="run", world=WORLD, positioned=PLAN.positioned, pace=Pace(dt=0.01, factor=1.0, late=late)
    )
    supervisor = SimpleNamespace(waits=lambda *_: None, works=lambda _: None, lost=lambda *_: None)
    world = DrivenWorld(air, supervisor, brief, Intake(Trust("fail", 1 << 20, 100, frozenset())), kept.append)
    air.robots(0)
    return air, world, kept, world.begin()


def stepped(world, tick, scene):
    return world.step(tick, scene, world.measure(tick, scene, CALM), np.zeros((len(AGENTS), 2)), CALM)


def test_a_driver_that_answers_each_command_in_its_tick_is_not_late():
    air, world, kept, scene = begun()
    for tick in range(4):
        if tick:
            air.robots(tick)  # after the command of the tick before
        scene = stepped(world, tick, scene)
    assert [(one.process, one.tick, one.late, one.missed) for one in kept] == [("driver", n, 0.0, 0) for n in range(4)]
    assert len(air.commands) == 4 * len(AGENTS)


def test_a_driver_is_as_late_as_the_last_of_its_robots():
    air, world, kept, scene = begun()
    for tick in range(4):
        for agent in AGENTS:
            air.robot(agent, 0 if agent == 5 else tick)
        scene = stepped(world, tick, scene)
    assert [one.late for one in kept] == pytest.approx([0.0, 0.01, 0.02, 0.03])
    assert [one.missed for one in kept] == [0, 1, 1, 1]


def test_it_fails_the_run_when_it_is_later_than_that_may_be():
    air, world, _, scene = begun(late=0.015)
    for tick in range(2):
        scene = stepped(world, tick, scene)
    with pytest.raises(TooLate, match="the robot of agent 1 has said nothing of what is measured after tick 0"):
        stepped(world, 2, scene)
    assert not air.said


def test_of_what_came_since_the_tick_before_the_newest_stays_and_the_rest_is_a_gap():
    air, world, _, scene = begun()
    air.robot(4, 0, [(1, (1.0, 1.0)), (2, (2.0, 2.0))], (5.0, 6.0))
    air.robot(4, 0, [(1, (3.0, 4.0))], (7.0, 8.0))
    scene = stepped(world, 0, scene)
    measured = world.measure(1, scene, CALM)
    there = np.flatnonzero(~np.isnan(measured).any(axis=-1)).tolist()
    assert there == sorted([WORLD.links.index[1, 4], WORLD.links.index[2, 4]])
    assert measured[WORLD.links.index[1, 4]].tolist() == [-3.0, -4.0]
    assert scene.position[3].tolist() == [7.0, 8.0]
    scene = stepped(world, 1, scene)
    assert np.isnan(world.measure(2, scene, CALM)).all()
    assert scene.position[3].tolist() == [7.0, 8.0]
