"""Which processes a run has besides the world, and on which machine each is."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from affinet.planning.plan import Plan
from affinet.runtimes.machines.hosts import Hosts, Machine
from netem.wire.session import HUB, agent_name, host_name


class Seats(NamedTuple):
    """Where the processes of a run are.

    Parameters
    ----------
    groups
        Agents that are on one machine, for each.
    of_machines
        For each other machine the commands that hold its seats: the words behind `affinet`.
    machines
        By name of each seat on another machine what that is called; None for what it calls itself.
    """

    groups: tuple[tuple[int, ...], ...]
    of_machines: tuple[tuple[Machine, tuple[tuple[str, ...], ...]], ...]
    machines: dict[str, str | None]


def hosts_of(
    plan: Plan, programs: Collection[int], groups: Sequence[Collection[int]] = ()
) -> dict[int, tuple[int, ...]]:
    """The processes that carry several agents, and which.

    Programs fly on their own, and so does who would be alone; who is in no group with another is in no process with it.
    """
    size = plan.scenario.agents.per_process
    ours = [number for number in range(1, plan.world.links.agents + 1) if number not in programs]
    grouped = {number for group in groups for number in group}
    parted = [*groups, [number for number in ours if number not in grouped]]
    carried = [
        tuple(together[first : first + size])
        for group in parted
        for together in [[number for number in ours if number in group]]
        for first in range(0, len(together), size)
    ]
    return dict(enumerate((many for many in carried if len(many) > 1), 1))


def by_hand(plan: Plan) -> Seats:
    """All but the world and a centre are elsewhere: their commands are typed by somebody."""
    hosts = hosts_of(plan, ())
    return Seats((), (), dict.fromkeys((HUB, *_names(hosts, range(1, plan.world.links.agents + 1)))))


def spread_over(plan: Plan, hosts: Hosts) -> Seats:
    """Those are elsewhere whom a file says to be."""
    hosts.refuse_strangers(plan.world.links.agents)
    groups = tuple(tuple(machine.agents) for machine in hosts.machines)
    carried = hosts_of(plan, (), groups)
    of_machines, machines = [], dict[str, str | None]()
    for machine in hosts.machines:
        there = {host: agents for host, agents in carried.items() if agents[0] in machine.agents}
        seats = _names(there, machine.agents)
        commands = [_command(role, seats) for role in ("agent", "host")]
        if machine.netem is not None:
            commands.insert(0, ("netem", "--listen", machine.netem))
            machines[HUB] = machine.name
        machines |= dict.fromkeys(seats, machine.name)
        of_machines.append((machine, tuple(filter(None, commands))))
    return Seats(groups, tuple(of_machines), machines)


def _names(hosts: Mapping[int, Collection[int]], agents: Collection[int]) -> list[str]:
    carried = {agent for of_host in hosts.values() for agent in of_host}
    return [*map(host_name, hosts), *(agent_name(agent) for agent in agents if agent not in carried)]


def _command(role: str, seats: Sequence[str]) -> tuple[str, ...]:
    numbers = [name.removeprefix(f"{role}-") for name in seats if name.startswith(f"{role}-")]
    return (role, *numbers) if numbers else ()
