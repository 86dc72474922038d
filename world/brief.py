"""What the world process is told; apart from the process, which takes a second to load its recorder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from analysis.models.arrays import Array, Mask
from netem.core.pace import Pace
from netem.faults.fault import Fault
from netem.faults.trigger import Trigger
from netem.wire.intake import Trust
from netem.wire.session import Login
from world.books.scenery import Scenery
from world.physics.world import World


@dataclass(frozen=True)
class RecordOptions:
    """How a run is written down.

    Parameters
    ----------
    every
        Ticks from one moment that is recorded, and whose graph is looked at, to the next.
    batch
        How many ticks are written down at once: no more than a second of them, which who is killed has not written yet.
    window
        Ticks over which links count as working together.
    record
        Whether to make a recording.
    viewer
        URL of a viewer to stream to.
    settings
        The scenario, as Markdown.
    scenery
        What the swarm flies through.
    """

    every: int
    batch: int
    window: int
    record: bool
    viewer: str | None
    settings: str
    scenery: Scenery


@dataclass(frozen=True)
class WorldBrief:
    """All the world process is told.

    Parameters
    ----------
    run, login
        Where it connects, and as whom.
    out
        The run directory.
    world, channels, faults, triggers
        What it simulates.
    reports
        What the agents' estimators report beyond edges, by name, and the shape of each for one agent.
    limit
        The longest input that agents command, if the scenario sets one.
    trust
        What is taken from agents.
    is_outside, positioned
        Whether a driver flies the bodies, and of whom it has to say where he is, shape (N,).
    books
        How it writes that down.
    pace
        How time goes in a run in real time; None in lockstep.
    """

    run: str
    login: Login
    out: str
    world: World
    channels: tuple[str, ...]
    faults: tuple[Fault, ...]
    triggers: tuple[Trigger, ...]
    reports: Mapping[str, tuple[int, ...]]
    limit: float | None
    trust: Trust
    is_outside: bool
    positioned: Mask
    books: RecordOptions
    pace: Pace | None


@dataclass(frozen=True)
class DriverBrief:
    """All that the driver of robots outside is told.

    Parameters
    ----------
    run, login
        Where it connects, and as whom.
    neighbours
        Of each agent, from 1, the agents it may measure.
    nominal
        Its place in the formation, shape (N, D), in metres.
    positioned
        Whose position has to be known, shape (N,).
    dt, ticks
        Tick, in seconds, and how many there are.
    factor
        Simulated seconds in a second, in a run in real time; None in lockstep, which waits for the driver in each tick.
    """

    run: str
    login: Login
    neighbours: tuple[tuple[int, ...], ...]
    nominal: Array
    positioned: Mask
    dt: float
    ticks: int
    factor: float | None

    @classmethod
    def of(cls, run: str, login: Login, world: World, positioned: Mask, pace: Pace | None) -> DriverBrief:
        """What is told of a world."""
        links = world.links
        return cls(
            run,
            login,
            tuple(links.neighbours_of(agent) for agent in range(1, links.agents + 1)),
            world.formation.nominal,
            positioned,
            world.dt,
            world.ticks,
            None if pace is None else pace.factor,
        )
