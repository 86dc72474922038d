"""Commands of runs over several machines."""

from __future__ import annotations

import argparse

from affinet.cli.options import values
from affinet.cli.options.scenarios import add_output, add_overrides, add_scenario

_LONGEST_DAYS = 3650  # as long as the authority


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add them."""
    _add_keys(commands)
    _add_coordinators(commands)
    _add_seats(commands)


def _add_keys(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    keys = commands.add_parser(
        "keys",
        help="certificates for runs over several machines",
        description="Make an authority, and a certificate and a key for each process of a run. Run again, it makes new "
        "certificates of the same authority for all who have one. docs/trust.md says what goes to which machine.",
    )
    keys.add_argument("directory", type=values.path, metavar="DIR", help="where to keep them, for this user alone")
    keys.add_argument(
        "--agents", type=values.count, default=10, metavar="N", help="for agents 1 to N (default: %(default)s)"
    )
    keys.add_argument(
        "--hosts", type=values.count, metavar="N", help="for N processes that carry several agents (agents.per_process)"
    )
    keys.add_argument(
        "--hub",
        nargs="+",
        default=[],
        metavar="ADDRESS",
        help="host names and IP addresses under which the medium is reached, besides loopback",
    )
    keys.add_argument(
        "--days",
        type=values.up_to(_LONGEST_DAYS),
        default=30,
        metavar="D",
        help="how long they are valid (default: %(default)s)",
    )


def _add_coordinators(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    hosts = commands.add_parser(
        "hosts", help="fly a scenario over several machines, whose commands are started from here"
    )
    hosts.add_argument(
        "file", type=values.path, metavar="HOSTS", help="which machines, and who is on which: docs/machines.md"
    )
    hosts.add_argument("scenario", nargs="?", help="in place of the one in the file")
    world = commands.add_parser("world", help="fly a scenario over several machines, whose commands are typed there")
    add_scenario(world)
    world.add_argument("--listen", required=True, metavar="tls/ADDRESS:PORT", help="where they find this machine")
    world.add_argument("--keys", required=True, metavar="DIR", help="made by `affinet keys`")
    world.add_argument(
        "--gone-after",
        type=values.positive,
        default=20.0,
        metavar="S",
        help="give up a silent machine (default: %(default)s)",
    )
    for command in (hosts, world):
        command.set_defaults(runtime="processes")
        add_overrides(command)
        add_output(command)


def _add_seats(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    agent = commands.add_parser("agent", help="hold agents of a run over several machines on this one")
    agent.add_argument("numbers", nargs="+", type=values.count, metavar="N", help="which")
    host = commands.add_parser("host", help="hold processes that carry several agents (agents.per_process)")
    host.add_argument("numbers", nargs="+", type=values.count, metavar="N", help="which")
    netem = commands.add_parser("netem", help="hold the medium of a run over several machines on this one")
    netem.add_argument("--listen", required=True, metavar="tls/ADDRESS:PORT", help="where all others find it")
    for command in (agent, host, netem):
        command.add_argument(
            "--connect", required=True, metavar="tls/ADDRESS:PORT", help="where `affinet world` listens"
        )
        command.add_argument("--keys", required=True, metavar="DIR", help="the certificates of this machine")
        command.add_argument("--scenario", help="refuse to fly any other; without it what the others fly is taken")
        command.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="overrides of that")
