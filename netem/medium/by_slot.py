"""What there is on links, by the slots of the agents at their ends."""

from __future__ import annotations

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links


def sensed(measured: Array, reached: Mask, links: Links) -> tuple[Array, Mask]:
    """Relative positions (N, n, D) of the edges in each agent's slots, 0 where none is seen, and which are, shape (N, n).

    Parameters
    ----------
    measured, reached
        On each link, shape (L, D), and whether that gets to who measured it, shape (L,).
    links
        Of the swarm.
    """
    edges: tuple[Array, Mask] = _sensed(measured, reached, links.slots, links.present)
    return edges


def arriving(newest: Integers, links: Links, tick: int) -> tuple[Mask, Integers]:
    """In which slots something arrives in this tick, and how many ticks old it is, 0 elsewhere, both shape (C, N, n).

    Parameters
    ----------
    newest
        Of which tick what arrives on each channel and link speaks, -1 for nothing, shape (C, L).
    links
        Of the swarm.
    tick
        Now.
    """
    heard: tuple[Mask, Integers] = _arriving(newest[:, None], links.slots, links.present, tick)
    return heard


@kernel("(l,D),(l),(n),(n)->(n,D),(n)", "d?l?->d?")
def _sensed(D: int) -> Plain:
    def plain(measured: Array, reached: Mask, slots: Integers, present: Mask, of_edges: Array, seen: Mask) -> None:
        for slot in range(len(slots)):
            seen[slot] = present[slot] and reached[slots[slot]]
            for axis in range(D):
                of_edges[slot, axis] = measured[slots[slot], axis] if seen[slot] else 0.0

    return plain


@kernel("(l),(n),(n),()->(n),(n)", "ll?l->?l")
def _arriving() -> Plain:
    def plain(newest: Integers, slots: Integers, present: Mask, tick: int, fresh: Mask, age: Integers) -> None:
        for slot in range(len(slots)):
            fresh[slot] = present[slot] and newest[slots[slot]] >= 0
            age[slot] = tick - newest[slots[slot]] if fresh[slot] else 0

    return plain
