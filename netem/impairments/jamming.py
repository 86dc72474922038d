"""Jammed zones: whoever is inside hears nothing while the jammer is on, all at once."""

from __future__ import annotations

from dataclasses import dataclass

from analysis.models.arrays import Array, Integers, Mask


@dataclass(frozen=True)
class Zone:
    """A ball in which a jammer works.

    Parameters
    ----------
    centre
        Shape (D,), in metres.
    radius
        In metres.
    share
        Share of ticks in which the jammer is on, independently from tick to tick.
    rows
        True on the links it can jam, shape (L,).
    sensing, comms
        The channel classes on which it acts.
    """

    centre: Array
    radius: float
    share: float
    rows: Mask
    sensing: bool
    comms: bool

    def jammed(self, receivers: Integers, position: Array) -> Mask:
        """True on the links whose receiver, a row of positions (..., N, D), is inside, shape (..., L), while the jammer is on.

        One draw a tick serves the whole zone: its links share their verdict. In the zone, mean loss is `share`.
        """
        apart = position - self.centre
        inside = (apart * apart).sum(axis=-1) <= self.radius * self.radius
        struck: Mask = inside[..., receivers] & self.rows
        return struck
