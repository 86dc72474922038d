"""Many runs of one plan as one: swarms that fly side by side, each with draws of its own.

A batch is a plan of as many agents as all its runs have together, and of no link between two of them. Whatever flies a plan
flies a batch, and every run in it is the run that would have been flown alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from affinet.planning.plan import Plan
from agents.brief import Brief
from netem.faults.fault import Fault
from netem.impairments.chain import ChainLayer
from netem.impairments.delay import MessageDelay
from netem.impairments.profile import Profile
from world.formation.nominal import Formation


class NotABatch(ValueError):
    """The plan has something that cannot be flown side by side."""


def side_by_side(plan: Plan, seeds: Sequence[int]) -> Plan:
    """The runs of a plan with each of these seeds, as one plan.

    Raises
    ------
    NotABatch
        When its air depends on positions, counts messages, or follows a trace; or a fault waits for a condition.
    """
    number, world = len(seeds), plan.world
    size = world.formation.agents
    for profile in plan.profiles:
        _refuse(profile)
    if plan.triggers or plan.journal:
        raise NotABatch("a fault that waits for a condition comes at another time in each run; fly them one by one")
    links = world.links.side_by_side(number)
    return replace(
        plan,
        world=replace(
            world,
            swarm_seeds=np.repeat(np.array(seeds, dtype=np.uint64), size),
            formation=_formation(world.formation, number),
            links=links,
            swarms=number,
        ),
        profiles=tuple(_profile(profile, number) for profile in plan.profiles),
        faults=tuple(_fault(fault, number, size) for fault in plan.faults),
        brief=_brief(plan.brief, number),
    )


def _refuse(profile: Profile) -> None:
    for what, held in (
        ("a trace", profile.traces),
        ("a schedule", profile.schedules),
        ("loss by distance", profile.reaches),
        ("a jammed zone", profile.zones),
        ("a list of messages", len(profile.listed)),
        ("a rate limit", profile.rate),
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


def _profile(one: Profile, number: int) -> Profile:
    return replace(
        one,
        chains=tuple(_chains(layer, number) for layer in one.chains),
        own=tuple(replace(loss, rows=np.tile(loss.rows, number)) for loss in one.own),
        delays=tuple(_delay(law, number) for law in one.delays),
        duplicate=np.tile(one.duplicate, number),
        reorder=np.tile(one.reorder, number),
        corrupt=np.tile(one.corrupt, (number, 1)),
        bias=np.tile(one.bias, number),
    )


def _chains(layer: ChainLayer, number: int) -> ChainLayer:
    return replace(
        layer,
        cumulative=np.tile(layer.cumulative, (number, 1, 1)),
        start=np.tile(layer.start, (number, 1)),
        loss=np.tile(layer.loss, (number, 1)),
        extra_delay=np.tile(layer.extra_delay, (number, 1)),
        by_packet=np.tile(layer.by_packet, number),
    )


def _delay(law: MessageDelay, number: int) -> MessageDelay:
    return replace(law, rows=np.tile(law.rows, number))


def _fault(fault: Fault, number: int, size: int) -> Fault:
    first = [place * size for place in range(number)]
    return replace(
        fault,
        pairs=tuple((src + offset, dst + offset) for offset in first for src, dst in fault.pairs),
        groups=tuple(tuple(agent + offset for offset in first for agent in group) for group in fault.groups),
        agents=tuple(agent + offset for offset in first for agent in fault.agents),
    )
