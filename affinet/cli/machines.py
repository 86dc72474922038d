"""The commands of runs over several machines: those that coordinate, and those that hold seats."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from affinet.planning.plan import Plan
from affinet.runtimes.child import RunFailed
from affinet.runtimes.machines import hosts, seats
from affinet.runtimes.machines.commands import Command, Commands
from affinet.runtimes.machines.coordinator import Coordinator
from affinet.runtimes.machines.hosts import Hosts, Machine
from affinet.runtimes.machines.identity import digest_of
from affinet.runtimes.machines.machine import CoordinatorGone, Wanted, serve
from affinet.runtimes.machines.seats import Seats
from affinet.runtimes.machines.spread import Spread
from affinet.scenario import files, loading
from affinet.scenario.words import one_line
from netem.wire import endpoints
from netem.wire.session import COORDINATOR, HUB, Login, seat_name

_DONE, _FAILED = 0, 1


def typed(plan: Plan, parsed: argparse.Namespace) -> Callable[[Path], Spread]:
    """All but the world is elsewhere, and its commands are typed there."""
    endpoints.listening(parsed.listen)
    found = seats.by_hand(plan)
    keys, medium = str(Path(parsed.keys).absolute()), hosts.beside(parsed.listen)
    return partial(_spread, plan, found, parsed.listen, medium, keys, parsed.gone_after, ())


def started(plan: Plan, read: Hosts, folder: Path) -> Callable[[Path], Spread]:
    """What a file says is elsewhere, and its commands are started from here."""
    endpoints.listening(read.listen)
    found = seats.spread_over(plan, read)
    commands = [
        Command(machine.name, _words(machine, words, read, folder))
        for machine, of_machine in found.of_machines
        for words in of_machine
    ]
    keys = str(folder / read.keys)
    return partial(_spread, plan, found, read.listen, read.medium_listens, keys, read.gone_after, commands)


def hold(parsed: argparse.Namespace) -> int:
    """Hold seats until the run is over."""
    numbers = getattr(parsed, "numbers", None)
    names = [HUB] if numbers is None else [seat_name(parsed.command, number) for number in dict.fromkeys(numbers)]
    listen = getattr(parsed, "listen", None)
    endpoints.over_machines(parsed.connect)
    if listen is not None:
        endpoints.listening(listen)
    scenario = None
    if parsed.scenario is not None:
        scenario = digest_of(loading.load(parsed.scenario, parsed.set, files.working_directory()))
    try:
        serve(Wanted(tuple(names), parsed.connect, parsed.keys, listen, scenario), _say)
    except (CoordinatorGone, RunFailed) as error:
        _say(one_line(str(error)))
        return _FAILED
    return _DONE


def _spread(
    plan: Plan,
    found: Seats,
    listen: str,
    medium: str,
    keys: str,
    gone_after_s: float,
    commands: Sequence[Command],
    out: Path,
) -> Spread:
    coordinator = Coordinator(
        Login(listen, COORDINATOR, keys=keys),
        found.machines,
        scenario=digest_of(plan.scenario),
        gone_after_s=gone_after_s,
        tell=_say,
    )
    return Spread(coordinator, found.groups, Commands(commands, out / "logs"), medium, keys, out)


def _words(machine: Machine, words: tuple[str, ...], read: Hosts, folder: Path) -> tuple[str, ...]:
    keys = machine.keys or str(folder / read.keys)
    return (*machine.command, machine.affinet, *words, "--connect", read.listen, "--keys", keys)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)  # noqa: T201
