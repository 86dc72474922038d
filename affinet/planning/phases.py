"""What a timeline makes of the stress, phase by phase: which modes of the formation RAL leaves without control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agents.algebra import completion, stability
from agents.swarm import SwarmBrief
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from netem.core.links import Links
from netem.core.listing import listed
from netem.faults.conditions import Conditions
from netem.faults.fault import Fault
from netem.faults.timeline import Timeline
from netem.medium.verdict import PASSED, standing

_ZERO = 1e-6  # of eigenvalues, as a share of the largest where nothing is missing


class Graph(NamedTuple):
    """Over which links measurements pass, shape (L,), who takes part, and whose inputs follow from them, shape (N,)."""

    measured: Mask
    present: Mask
    steered: Mask


class Phase(NamedTuple):
    """Ticks from one change of the graph to the next, and the graph."""

    start: int
    end: int
    graph: Graph


def completed_stress(swarm: SwarmBrief, links: Links, graph: Graph) -> tuple[Array, Mask]:
    """The followers' block of the stress as their own fits complete it, shape (F, F), and who has a fit, shape (N,).

    Parameters
    ----------
    swarm, links
        The swarm, and its nominal graph.
    graph
        What is left of it.
    """
    neighbours, slots = swarm.neighbours, np.arange(swarm.agents)[:, None]
    nominal = np.where(swarm.present, -swarm.stress[slots, neighbours], 0.0)
    relative = np.where(swarm.present[..., None], swarm.nominal[:, None] - swarm.nominal[neighbours], 0.0)
    weights, fits = completion.completed(nominal, relative, graph.measured[links.slots] & swarm.present)
    matrix = np.diag(weights.sum(axis=1))
    np.subtract.at(matrix, (slots, neighbours), weights)
    return matrix[np.ix_(graph.steered, graph.steered)], fits


def of_timeline(swarm: SwarmBrief, links: Links, faults: Sequence[Fault]) -> list[Finding]:
    """For each graph in which followers miss edges: the eigenvalues of their completed stress, and what they leave open."""
    whole = _graph(swarm, links, Timeline(links, ()).at(0))
    alike: list[list[Phase]] = []
    for phase in phases(swarm, links, faults):
        kept = next((others for others in alike if _same(swarm, links, others[0].graph, phase.graph)), None)
        if kept is not None:
            kept.append(phase)
        elif not _same(swarm, links, phase.graph, whole):
            alike.append([phase])
    found = [_finding(swarm, links, first, len(again), whole) for first, *again in alike]
    if waiting := sum(fault.trigger is not None for fault in faults):
        says = f"of {waiting} that wait for a condition, nobody knows the time: these faults are in no phase"
        found.append(Finding("phases", "ok", says))
    return found


def phases(swarm: SwarmBrief, links: Links, faults: Sequence[Fault]) -> list[Phase]:
    """All phases of a timeline, in order; faults that wait for a condition are in none."""
    timeline, placed = Timeline(links, faults), [fault for fault in faults if fault.trigger is None]
    changes = {0, *(fault.start for fault in placed), *(fault.end for fault in placed if fault.end is not None)}
    begins = sorted(tick for tick in changes if tick < swarm.ticks)
    found: list[Phase] = []
    for start, end in zip(begins, [*begins[1:], swarm.ticks], strict=True):
        graph = _graph(swarm, links, timeline.at(start))
        if found and _same(swarm, links, found[-1].graph, graph):
            found[-1] = found[-1]._replace(end=end)
        else:
            found.append(Phase(start, end, graph))
    return found


def _graph(swarm: SwarmBrief, links: Links, now: Conditions) -> Graph:
    passes = (standing(links, now) == PASSED) & (now.loss < 1.0) & (now.dropout < 1.0) & ~now.paused[links.dst - 1]
    return Graph(passes, ~now.absent, ~(swarm.leader | now.absent | now.paused))


def _same(swarm: SwarmBrief, links: Links, one: Graph, other: Graph) -> bool:
    """Whether followers measure the same; what leaders do is nothing to the stress."""
    followed = ~swarm.leader[links.dst - 1]
    return bool((one.measured == other.measured)[followed].all() and (one.steered == other.steered).all())


def _finding(swarm: SwarmBrief, links: Links, phase: Phase, again: int, whole: Graph) -> Finding:
    graph, begin, end = phase.graph, phase.start * swarm.dt, phase.end * swarm.dt
    more = f", and {again} times more," if again else ""
    check, when = f"phase {begin:g} s", f"from {begin:g} to {end:g} s{more} {_without(links, graph, whole)}"
    if not graph.steered.any():
        return Finding(check, "note", f"{when}: no follower takes part")
    matrix, fits = completed_stress(swarm, links, graph)
    spectrum = np.linalg.eigvals(matrix)
    zero = _ZERO * stability.radius(swarm.follower_stress)
    real = np.sort(np.where(np.abs(spectrum) <= zero, 0.0, spectrum.real))
    words = [f"{when}: completed stress of the followers has eigenvalues {', '.join(f'{each:.4f}' for each in real)}"]
    if unfit := (np.flatnonzero(graph.steered & ~fits) + 1).tolist():
        words.append(f"agents {unfit} measure too few edges for a fit")
    if still := int((np.abs(spectrum) <= zero).sum()):
        words.append(f"{still} {'mode' if still == 1 else 'modes'} uncontrolled under RAL")
    if away := int((real < -zero).sum()):
        words.append(f"{away} {'mode runs' if away == 1 else 'modes run'} away under RAL")
    return Finding(check, "note" if unfit or still or away else "ok", "; ".join(words))


def _without(links: Links, graph: Graph, whole: Graph) -> str:
    """Who takes no part, and which links toward those that do are missing."""
    absent = (np.flatnonzero(~graph.present) + 1).tolist()
    deaf = (np.flatnonzero(whole.steered & graph.present & ~graph.steered) + 1).tolist()
    hearing = graph.steered[links.dst - 1] & graph.present[links.src - 1]
    missing = np.flatnonzero(hearing & ~graph.measured)
    named = listed(f"{links.src[row]}->{links.dst[row]}" for row in missing)
    words = [
        *([f"without agents {absent}"] if absent else []),
        *([f"with agents {deaf} paused"] if deaf else []),
        *([f"without {named}"] if named else []),
    ]
    return ", ".join(words)
