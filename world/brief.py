"""What the world process is told; apart from the process, which takes a second to load its recorder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from netem.core.pace import Pace
from netem.faults.fault import Fault
from netem.faults.trigger import Trigger
from netem.wire.intake import Trust
from netem.wire.session import Login
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
    """

    every: int
    batch: int
    window: int
    record: bool
    viewer: str | None


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
    books: RecordOptions
    pace: Pace | None
