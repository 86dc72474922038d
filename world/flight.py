"""The flight of a swarm: sense, hand over, get back what everybody does, step. Every runtime flies by this alone.

When a tick begins is up to the clock; how what is sensed reaches the agents, and what they do comes back, is up to the carrier.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

from analysis.models.arrays import Array
from netem.core.clock import Clock
from netem.faults.conditions import Conditions
from netem.faults.timeline import Timeline
from world.books.history import ErrorMonitor
from world.physics.world import Scene


class Acted(Protocol):
    """What came back of a tick."""

    @property
    def input(self) -> Array:
        """What the agents steer, shape (N, D), in metres per second, per second squared ...; 0 of those who are idle."""


Act = TypeVar("Act", bound=Acted)
Act_co = TypeVar("Act_co", bound=Acted, covariant=True)


class Carrier(Protocol[Act_co]):
    """Carries what the world senses to the agents, through the medium, and back what they do."""

    @property
    def timeline(self) -> Timeline:
        """The faults of the run, as far as they are known by now."""

    def fire(self, tick: int, triggers: Sequence[int]) -> None:
        """From this tick on, what waited for these triggers holds."""

    def carry(self, tick: int, scene: Scene, measured: Array) -> Act_co:
        """Hand over what is sensed in a tick, shape (L, D), in metres, and get back what comes of it."""


class Physics(Protocol):
    """What a swarm flies in: simulated, recorded, or outside."""

    def begin(self) -> Scene:
        """The scene in tick 0."""

    def measure(self, tick: int, scene: Scene, now: Conditions) -> Array:
        """What sensors say of every directed link, shape (L, D)."""

    def flown(self, tick: int, scene: Scene, commanded: Array, now: Conditions) -> Array:
        """What bodies fly when their agents command this, shape (N, D)."""

    def goal(self, tick: int, scene: Scene) -> Array:
        """Where every agent should be, shape (N, D), in metres."""

    def step(self, tick: int, scene: Scene, measured: Array, flown: Array, now: Conditions) -> Scene:
        """The scene of the next tick."""


class FlownTick(NamedTuple, Generic[Act]):
    """A tick as it was flown.

    Parameters
    ----------
    tick
        Its number.
    scene, following
        Where the agents were, and where it led.
    measured
        What the sensors said, shape (L, D), in metres.
    input
        What the bodies flew, shape (N, D).
    acted
        What came back from the agents.
    """

    tick: int
    scene: Scene
    following: Scene
    measured: Array
    input: Array
    acted: Act


def fly(world: Physics, clock: Clock, carrier: Carrier[Act]) -> Iterator[FlownTick[Act]]:
    """Tick after tick; a swarm that diverges overflows, and whoever flies it knows."""
    scene, monitor = world.begin(), ErrorMonitor(world)
    for tick in clock:
        if triggers := carrier.timeline.due(monitor.errors):
            carrier.fire(tick, triggers)
        measured = world.measure(tick, scene, carrier.timeline.at(tick))
        acted = carrier.carry(tick, scene, measured)
        now = carrier.timeline.at(tick)
        flown = world.flown(tick, scene, acted.input, now)
        monitor.see(tick, scene, carrier.timeline)
        following = world.step(tick, scene, measured, flown, now)
        yield FlownTick(tick, scene, following, measured, flown, acted)
        scene = following
