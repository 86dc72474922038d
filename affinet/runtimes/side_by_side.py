"""Many runs as one: swarms that fly side by side, each with draws of its own.

A batch is a plan of as many agents as all its runs have together, and of no link between two of them. Whatever flies a plan
flies a batch, and every run in it is the run that would have been flown alone. Runs of several plans fly in one batch where
the plans are alike (`alike.py`): what differs is laid over the links of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import accumulate
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from affinet.planning.plan import Plan
from affinet.runtimes.alike import alike
from agents.brief import Brief
from netem.faults.fault import Fault
from netem.impairments.chain import ChainLayer, steady
from netem.impairments.profile import Profile
from world.formation.nominal import Formation

# The air of some runs, and how many they are.
_Airs = Sequence[tuple[Profile, int]]


class NotABatch(ValueError):
    """The plans have something that cannot be flown side by side."""


class Flight(NamedTuple):
    """Runs of a plan with each of these seeds."""

    plan: Plan
    seeds: Sequence[int]


def side_by_side(plan: Plan, seeds: Sequence[int]) -> Plan:
    """The runs of a plan with each of these seeds, as one plan.

    Raises
    ------
    NotABatch
        When its air depends on positions, counts messages, or follows a trace; a fault waits for a condition, or it is
        an earlier run that is flown again.
    """
    return together([Flight(plan, seeds)])


def together(flights: Sequence[Flight]) -> Plan:
    """The runs of several plans, one after the other, as one plan.

    Raises
    ------
    NotABatch
        When the plans are not alike, or one of them cannot be flown side by side.
    """
    plan, world = flights[0].plan, flights[0].plan.world
    for other, _ in flights[1:]:
        if not alike(plan, other):
            raise NotABatch("plans that differ in more than what each link has for itself are not flown side by side")
    for profile in plan.profiles:
        _refuse(profile)
    if plan.triggers:
        raise NotABatch("a fault that waits for a condition comes at another time in each run; fly them one by one")
    if plan.journal or plan.injected:
        raise NotABatch("a run that is flown again is flown alone; fly the runs one by one")
    seeds = np.concatenate([np.array(flight.seeds, dtype=np.uint64) for flight in flights])
    number, size = len(seeds), world.formation.agents
    return replace(
        plan,
        world=replace(
            world,
            swarm_seeds=np.repeat(seeds, size),
            formation=_formation(world.formation, number),
            links=world.links.side_by_side(number),
            swarms=number,
            flight=None if world.flight is None else world.flight.side_by_side(number),
        ),
        profiles=tuple(
            _profile([(flight.plan.profiles[place], len(flight.seeds)) for flight in flights])
            for place in range(len(plan.profiles))
        ),
        faults=tuple(faults_of(flights)),
        brief=_brief(plan.brief, number),
    )


def _refuse(profile: Profile) -> None:
    for what, held in (
        ("a trace", profile.traces or profile.delay_traces),
        ("a schedule", profile.schedules),
        ("loss by distance", profile.reaches),
        ("a jammed zone", profile.zones),
        ("a list of messages", len(profile.listed)),
        ("a rate limit", profile.limits),
    ):
        if held:
            raise NotABatch(f"an air with {what} is not flown side by side; fly the runs one by one")


def _formation(one: Formation, number: int) -> Formation:
    first = [place * one.agents for place in range(number)]
    return Formation(
        np.tile(one.nominal, (number, 1)),
        tuple((i + offset, j + offset) for offset in first for i, j in one.edges),
        tuple(leader + offset for offset in first for leader in one.leaders),
    )


def _brief(one: Brief, number: int) -> Brief:
    def tiled(array: Any) -> Any:
        return np.tile(array, (number,) + (1,) * (array.ndim - 1))

    return replace(
        one,
        number=tiled(one.number),
        nominal=tiled(one.nominal),
        relative=tiled(one.relative),
        present=np.tile(one.present, (number, 1)),
        back=tiled(one.back),
        stress=tiled(one.stress),
        leader=np.tile(one.leader, number),
        leads=np.tile(one.leads, (number, 1)),
        process=tiled(one.process),
    )


def _profile(airs: _Airs) -> Profile:
    def joined(of: Callable[[Profile], Any]) -> Any:
        return _joined((of(air), number) for air, number in airs)

    first = airs[0][0]
    return replace(
        first,
        chains=tuple(_layer(airs, lane) for lane in _lanes(airs)),
        own=_for_some_links(airs, attrgetter("own")),
        delays=_for_some_links(airs, attrgetter("delays")),
        **{name: joined(attrgetter(name)) for name in ("duplicate", "reorder", "corrupt", "bias")},
    )


def _for_some_links(airs: _Airs, of: Callable[[Profile], Sequence[Any]]) -> tuple[Any, ...]:
    """Losses or delays, which are the same in all but the links for which they are."""
    alike = zip(*(of(air) for air, _ in airs), strict=True)
    numbers = [number for _, number in airs]
    return tuple(
        replace(each[0], rows=_joined(zip((one.rows for one in each), numbers, strict=True))) for each in alike
    )


def _joined(parts: Iterable[tuple[Any, int]]) -> Any:
    """Arrays that begin with the links of a run, each for so many runs, one after the other."""
    return np.concatenate([np.tile(array, (number,) + (1,) * (array.ndim - 1)) for array, number in parts])


def _lanes(airs: _Airs) -> list[tuple[bool, bool, int]]:
    """What tells the layers of chains of profiles apart, in the order in which planning has them: sensing first."""
    return sorted({_lane(layer) for air, _ in airs for layer in air.chains})


def _lane(layer: ChainLayer) -> tuple[bool, bool, int]:
    return not layer.sensing, not layer.comms, layer.lane


def _layer(airs: _Airs, lane: tuple[bool, bool, int]) -> ChainLayer:
    """One layer for the links of all, with as many states as any has; who has none there never loses by it."""
    layers = [next((one for one in air.chains if _lane(one) == lane), None) for air, _ in airs]
    there = [layer for layer in layers if layer is not None]
    states = max(layer.loss.shape[-1] for layer in there)
    never = _never(there[0])
    padded = [_padded(never if layer is None else layer, states) for layer in layers]

    def joined(of: Callable[[ChainLayer], Any]) -> Any:
        return _joined((of(layer), number) for layer, (_, number) in zip(padded, airs, strict=True))

    names = ("cumulative", "start", "loss", "extra_delay", "by_packet")
    return replace(there[0], **{name: joined(attrgetter(name)) for name in names})


def _never(like: ChainLayer) -> ChainLayer:
    links = len(like.loss)
    by_packet = np.zeros(links, dtype=bool)
    return ChainLayer.of(like.lane, [steady()] * links, by_packet, sensing=like.sensing, comms=like.comms)


def _padded(layer: ChainLayer, states: int) -> ChainLayer:
    """The layer with so many states, those beyond its own never entered."""
    beyond = (0, states - layer.loss.shape[-1])
    return replace(
        layer,
        cumulative=np.pad(layer.cumulative, ((0, 0), beyond, beyond), constant_values=1.0),
        start=np.pad(layer.start, ((0, 0), beyond), constant_values=1.0),
        loss=np.pad(layer.loss, ((0, 0), beyond)),
        extra_delay=np.pad(layer.extra_delay, ((0, 0), beyond)),
    )


def faults_of(flights: Sequence[Flight]) -> Iterator[Fault]:
    """Those of all runs, each run's in its own order; one that several have in the same place is one."""
    size = flights[0].plan.world.formation.agents
    ends = [*accumulate((len(flight.seeds) for flight in flights), initial=0)]
    for place in range(max(len(flight.plan.faults) for flight in flights)):
        whose: dict[Fault, list[int]] = {}
        for flight, first, end in zip(flights, ends, ends[1:], strict=False):
            if place < len(flight.plan.faults):
                whose.setdefault(flight.plan.faults[place], []).extend(range(first, end))
        yield from (_fault(fault, [run * size for run in runs]) for fault, runs in whose.items())


def _fault(fault: Fault, before: Sequence[int]) -> Fault:
    """A fault of the runs that have so many agents before them."""
    return replace(
        fault,
        pairs=tuple((src + offset, dst + offset) for offset in before for src, dst in fault.pairs),
        groups=tuple(tuple(agent + offset for offset in before for agent in group) for group in fault.groups),
        agents=tuple(agent + offset for offset in before for agent in fault.agents),
    )
