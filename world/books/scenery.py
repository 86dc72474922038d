"""What a swarm flies through, as recordings and pictures show it; nothing collides with it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class JammedBall:
    """A disk, or a ball, in which nobody hears anything in a `share` of all ticks; metres."""

    centre: tuple[float, ...]
    radius: float
    share: float


@dataclass(frozen=True)
class Scenery:
    """The surroundings of a swarm.

    Parameters
    ----------
    walls
        Lines through points, in metres.
    zones
        Where it is jammed.
    hearing
        How far agents hear each other, in metres, if their links end somewhere.
    """

    walls: tuple[tuple[tuple[float, ...], ...], ...] = ()
    zones: tuple[JammedBall, ...] = ()
    hearing: float | None = None
