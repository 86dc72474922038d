"""Verdicts for the benches: a medium over synthetic links, and what it decides in many ticks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.models.arrays import Array, Mask
from netem.core.links import Links
from netem.faults.fault import Fault
from netem.faults.timeline import Timeline
from netem.impairments.chain import Chain, ChainLayer
from netem.impairments.profile import Profile
from netem.medium.in_flight import Verdicts
from netem.medium.medium import Medium

DT = 0.01
ONE = ("theta",)
_MOST_AGENTS = 2**16 - 2


def pairs(links: int) -> Links:
    """Links between agents who know nobody but each other: rows 2 n and 2 n + 1 are the two directions of pair n."""
    agents = min(links, _MOST_AGENTS) // 2 * 2
    return Links.both_ways(agents, [(agent, agent + 1) for agent in range(1, agents, 2)])


def ring(agents: int, reach: int) -> Links:
    """Each agent and its nearest neighbours on a circle, `reach` on each side."""
    edges = [(a + 1, (a + step) % agents + 1) for a in range(agents) for step in range(1, reach + 1)]
    return Links.both_ways(agents, edges)


def size(verdicts: int) -> tuple[Links, int]:
    """Links and ticks that make so many verdicts on one channel."""
    links = pairs(int(np.clip(verdicts // 1000, 100, 1000)))
    return links, -(-verdicts // len(links))


def profile(links: Links, channels: Sequence[str] = ONE, **impairments: Any) -> Profile:
    """A perfect profile apart from what is named."""
    none = np.zeros(len(links))
    perfect = {
        "dt": DT,
        "coupled": True,
        "least_delay": 0,
        **dict.fromkeys(("chains", "traces", "schedules", "reaches", "zones", "own", "delays", "delay_traces"), ()),
        "listed": np.empty((0, 4), dtype=np.int64),
        **dict.fromkeys(("duplicate", "reorder", "bias"), none),
        "corrupt": np.zeros((len(links), 4)),
        "rate": None,
        "rate_trace": None,
        "message_bits": np.full(len(channels), 512.0),
    }
    return Profile(**(perfect | impairments))


def layers(links: Links, *chains: Chain, by_packet: bool = False) -> tuple[ChainLayer, ...]:
    """Each chain on every link and channel."""
    stepping = np.full(len(links), by_packet)
    return tuple(
        ChainLayer.of(lane, [chain] * len(links), stepping, sensing=True, comms=True)
        for lane, chain in enumerate(chains)
    )


def medium(
    seed: int, links: Links, channels: Sequence[str] = ONE, faults: Sequence[Fault] = (), **impairments: Any
) -> Medium:
    """The air of some links with these impairments alone."""
    return Medium(seed, channels, [profile(links, channels, **impairments)], Timeline(links, faults))


def fly(air: Medium, ticks: int, offered: Mask | None = None, position: Array | None = None) -> Verdicts:
    """The verdicts of many ticks, shape (T, C, L), on messages offered (T, C, L); without `offered`, on all."""
    state, each = air.begin(), []
    always = np.ones_like(state.spoke)
    for tick in range(ticks):
        state, verdicts = air.judge(state, tick, always if offered is None else offered[tick], position)
        each.append(verdicts)
    return Verdicts(*(np.stack(field) for field in zip(*each, strict=True)))
