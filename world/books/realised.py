"""The realised graph of a run: what the messages delivered make of the nominal graph, tick by tick and channel by channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.models import graph
from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.faults.timeline import Timeline
from world.formation import stress
from world.formation.nominal import Formation


@dataclass(frozen=True, eq=False)
class Realised:
    """The functional graph in some ticks, for each channel, sensing first.

    Parameters
    ----------
    ticks
        Which, shape (T,).
    heard
        Links on which something arrived, shape (T, C, L).
    age_s
        How old the newest content is that has arrived, in seconds, NaN before any has, shape (T, C, L).
    connectivity
        Algebraic connectivity of the links that work both ways, among the agents that take part, shape (T, C).
    joint_connectivity
        That of all links that worked in the window up to the tick, shape (T, C).
    joint_edges
        Undirected edges that worked both ways in that window, shape (T, C, E).
    stress_dimension
        Dimension of the stresses that those edges can carry, shape (T, C); where it is 0, none stabilises the formation.
    feasible
        Agents whose measured neighbours determine an affine map (paper 000, Remark 1), shape (T, N).
    """

    ticks: Integers
    heard: Mask
    age_s: Array
    connectivity: Array
    joint_connectivity: Array
    joint_edges: Mask
    stress_dimension: Integers
    feasible: Mask

    def stabilised(self, formation: Formation) -> Mask:
        """Whether the edges that worked in the window still carry a stabilising stress, shape (T, C).

        A semidefinite program for every distinct set of edges: tens of milliseconds each.
        """
        return stress.stabilises(formation, self.joint_edges)


class GraphWatch:
    """Follows the realised graph of a run.

    Parameters
    ----------
    formation, links
        Who flies, and who is linked to whom.
    dt
        Tick, in seconds.
    window
        Ticks over which links count as working together.
    """

    def __init__(self, formation: Formation, links: Links, dt: float, window: int) -> None:
        self._formation, self._links = formation, links
        self._dt, self._window = dt, window
        self._edges = formation.ends + 1
        self._before: NDArray[np.int32] | None = None

    def follow(self, first: int, newest: NDArray[np.int32], timeline: Timeline, every: int = 1) -> Realised:
        """The graph of consecutive ticks, of every so manieth of them.

        Parameters
        ----------
        first
            The first tick; it follows the last one of the call before.
        newest
            The tick of which the newest arriving content speaks, -1 where nothing arrived, shape (T, C, L).
        timeline
            Who takes part.
        every
            Ticks from one that is looked at to the next.
        """
        links, agents = self._links, self._links.agents
        known = np.full((1, *newest.shape[1:]), -1, dtype=np.int32) if self._before is None else self._before
        whole = np.concatenate([known, newest])
        by_channel = np.moveaxis(whole, 1, 0)
        kept = slice(len(known), None, every)
        ticks = np.arange(first, first + len(newest))
        age = graph.age(by_channel, np.arange(first - len(known), first + len(newest)))[:, kept]
        heard, joint = by_channel[:, kept] >= 0, graph.joint(by_channel >= 0, self._window)[:, kept]
        present = timeline.present(ticks[::every].tolist())
        joint_edges = graph.undirected(joint, links.src, links.dst, self._edges)
        self._remember(whole)

        def connectivity(which: Mask) -> Array:
            return graph.algebraic_connectivity(graph.adjacency(which, links.src, links.dst, agents), present).T

        return Realised(
            ticks=ticks[::every],
            heard=np.moveaxis(heard, 0, 1),
            age_s=np.moveaxis(age, 0, 1) * self._dt,
            connectivity=connectivity(heard),
            joint_connectivity=connectivity(joint),
            joint_edges=np.moveaxis(joint_edges, 0, 1),
            stress_dimension=graph.stress_dimension(joint_edges, self._edges, self._formation.nominal).T,
            feasible=graph.feasible(heard[0], links.src, links.dst, self._formation.nominal),
        )

    def _remember(self, whole: NDArray[np.int32]) -> None:
        """As much as the next window and the next age need: what is newest of all stands in the first row."""
        tail = whole[-self._window :].copy()
        tail[0] = whole[: len(whole) - len(tail) + 1].max(axis=0)
        self._before = tail


def realise(newest: NDArray[np.int32], formation: Formation, timeline: Timeline, dt: float, window: int) -> Realised:
    """The realised graph of a whole run, from its array `newest` (ticks, C, L); `window` in ticks."""
    return GraphWatch(formation, timeline.links, dt, window).follow(0, newest, timeline)


def columns(realised: Realised, channels: Sequence[str]) -> dict[str, Any]:
    """The graph as columns of a table, a row for each tick and channel."""
    ticks, number = len(realised.ticks), len(channels)
    age = realised.age_s.reshape(ticks * number, -1)
    heard_of = ~np.isnan(age)
    mean = np.where(heard_of.any(axis=-1), np.where(heard_of, age, 0.0).sum(axis=-1), np.nan)
    return {
        "tick": np.repeat(realised.ticks, number),
        "channel": np.tile(np.arange(number), ticks),
        "links": realised.heard.sum(axis=-1).ravel(),
        "connectivity": realised.connectivity.ravel(),
        "joint_connectivity": realised.joint_connectivity.ravel(),
        "stress_dimension": realised.stress_dimension.ravel(),
        "mean_age_s": mean / np.maximum(heard_of.sum(axis=-1), 1),
        "feasible": np.repeat(realised.feasible.sum(axis=-1), number),
    }
