"""Losses of a user's own: what one is, what it is told of the messages of a tick, and on which links it acts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

from analysis.models.arrays import Array, Integers, Mask
from netem.loading.choice import Choice


class Offered(NamedTuple):
    """What is offered in a tick on the n links on which a loss acts; C channels, or 1 where they share a verdict.

    Parameters
    ----------
    tick, seconds
        Its number, and the simulated time.
    src, dst
        Agents who speak, or are looked at, and who hear, or look: their numbers, shape (n,).
    draw
        Uniform numbers, as many as the loss wants for a message, shape (C, n, draws).
    relative
        z_src - z_dst, true, shape (n, D), in metres; None for a loss that does not depend on positions.
    """

    tick: int
    seconds: float
    src: Integers
    dst: Integers
    draw: Array
    relative: Array | None


class Loss(Protocol):
    """A loss: a frozen dataclass of its parameters, with one pure method over arrays.

    `draws` says how many uniform numbers it wants for each message; `by_position` whether it depends on where the agents are.
    """

    draws: ClassVar[int]
    by_position: ClassVar[bool]

    def lost(self, offered: Offered) -> Mask:
        """True where a message is lost, if one is offered there at all, shape (C, n)."""


@dataclass(frozen=True)
class OwnLoss:
    """A loss of a user's own, and the links and channels on which it acts.

    Parameters
    ----------
    choice
        The loss.
    purpose
        What its draws are for: its name, and which it is of those of this name on a link.
    by_position
        Whether it depends on where the agents are.
    rows
        True on the links it acts on, shape (L,).
    sensing, comms
        The channel classes on which it acts.
    """

    choice: Choice
    purpose: str
    by_position: bool
    rows: Mask
    sensing: bool
    comms: bool
