"""`affinet keys`: certificates for runs over several machines."""

from __future__ import annotations

import argparse
from datetime import timedelta

from affinet.cli import show
from netem.wire import authority
from netem.wire.session import CENTRE, CONTROL, COORDINATOR, DRIVER, HUB, WORLD, agent_name, host_name


def write(parsed: argparse.Namespace) -> None:
    """Make them, and say what goes where.

    Raises
    ------
    NotTrusted, OSError
        When they cannot be made of what is there, or not be written.
    """
    agents, hosts = range(1, parsed.agents + 1), range(1, (parsed.hosts or 0) + 1)
    names = [COORDINATOR, HUB, WORLD, CENTRE, CONTROL, DRIVER, *map(agent_name, agents), *map(host_name, hosts)]
    made = authority.make(parsed.directory, names, parsed.hub, timedelta(days=parsed.days))
    show.keys(parsed.directory, made)
