"""Ticks in which nobody computes: the messages of GA-RKF by pipes, ZeroMQ, Ray actors and bare Zenoh."""

from __future__ import annotations

import importlib.util
import secrets
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from speed.launched import Cost
from speed.lines import Pipes
from speed.started import PeerFailed, Process, all_of

from affinet.planning.plan import Plan
from affinet.runtimes.private import socket_folder
from netem.wire import messages
from netem.wire.arrays import CODE, TRUTH, packed
from netem.wire.session import HUB, WORLD, agent_name

TRANSPORTS = ("pipes", "ZeroMQ", "Zenoh", "Ray actors")
_NEEDS = {"ZeroMQ": "zmq", "Ray actors": "ray"}
_TICK = 500  # a typical one
_FAREWELL = 10.0  # s


def is_installed(transport: str) -> bool:
    """Whether its package is there."""
    return importlib.util.find_spec(_NEEDS.get(transport, "zenoh")) is not None


@contextmanager
def standing(transport: str, plan: Plan, ticks: int) -> Iterator[Callable[[], Cost]]:
    """A floor that waits for its rounds: each call flies so many ticks.

    Between them its processes sleep. Those of Ray do not, they take a tenth of a core: each round of theirs starts them anew.

    Raises
    ------
    PeerFailed
        When it does not run on this machine.
    """
    agents, size = plan.world.formation.agents, sizes(plan)
    shared = {"agents": agents, "ticks": ticks, "size": size}
    if transport == "Ray actors":
        yield lambda: _by_ray(shared)
        return
    names = {"world": WORLD, "hub": HUB, **{str(agent): agent_name(agent) for agent in range(1, agents + 1)}}
    with tempfile.TemporaryDirectory(prefix="affinet-", dir=socket_folder()) as private:
        passwords = {role: secrets.token_hex(8) for role in names}
        Path(private, "users").write_text("".join(f"{name}:{passwords[role]}\n" for role, name in names.items()))
        if transport == "pipes":
            Pipes.lay(Path(private), agents)
        shared |= {"transport": transport, "folder": private}
        endpoint = f"unixsock-stream/{private}/z.sock"
        told = {
            role: shared | {"role": role, "login": [endpoint, name, passwords[role]]} for role, name in names.items()
        }
        with all_of("floor", told) as started:
            yield lambda: _round(started)


def _round(started: Mapping[str, Process]) -> Cost:
    world = started["world"]
    try:
        for process in (*(process for process in started.values() if process is not world), world):
            process.tell("go")
        return Cost(float(world.said()))
    except PeerFailed:  # the others would wait for it
        for process in started.values():
            process.kill()
        raise


def _by_ray(shared: Mapping[str, Any]) -> Cost:
    with all_of("ray_floor", {"driver": shared}) as started:
        cost = Cost(float(started["driver"].said()))
        daemons = psutil.Process(started["driver"].pid).children(recursive=True)
    psutil.wait_procs(daemons, timeout=_FAREWELL)  # they are busy with ending when their driver is gone
    return cost


def sizes(plan: Plan) -> dict[str, int]:
    """Typical packed sizes of a tick's messages."""
    number = np.random.default_rng(0).normal
    dimension, links = plan.world.formation.dimension, len(plan.world.links)
    agents = plan.world.formation.agents
    degree = round(links / agents)
    heard = round(degree * plan.scenario.network.availability)
    nothing = b""
    map_ = packed(number(size=(dimension, dimension)))
    said: dict[str, dict[str, Any]] = {
        "input": {"velocity": packed(number(size=dimension))},
        "measurement": {"neighbours": [1] * heard, "measured": packed(number(size=(heard, dimension)))},
        "theta": {"local": map_, "feasible": b"\1", "consensus": map_, "started": b"\1"},
    }
    broadcasts = [
        messages.pack(messages.Broadcast(k=_TICK, src=1, channel=name, seq=_TICK, payload=fields))
        for name, fields in said.items()
    ]
    told = {
        "sense": messages.pack(
            messages.Sense(
                k=_TICK,
                src=WORLD,
                seq=_TICK,
                last=False,
                measured=packed(number(size=(links, dimension))),
                position=packed(number(size=(agents, 2))),
                motion=None,
                sightings=None,
                fired=[],
            )
        ),
        "seen": messages.pack(
            messages.SenseInbox(
                k=_TICK,
                src=HUB,
                seq=_TICK,
                clock=_TICK,
                neighbours=[1] * heard,
                measured=packed(number(size=(heard, 2))),
                position=None,
                motion=None,
                sighting=None,
            )
        ),
        "heard": messages.pack_exchange(_TICK, _TICK, broadcasts * heard),
        "act": messages.pack(
            messages.Act(
                k=_TICK,
                src=1,
                seq=_TICK,
                input=packed(number(size=dimension)),
                estimate=packed(number(size=(degree, dimension))),
                known=packed(np.ones(degree), TRUTH),
                covariance=packed(number(size=(degree, dimension * (dimension + 1) // 2))),
                psi=0.1,
                feasible=True,
                reports={},
                heard=_TICK,
            )
        ),
        "journal": messages.pack(
            messages.Journal(
                k=_TICK,
                src=HUB,
                seq=_TICK,
                verdicts=packed(np.ones((4, links)), CODE),
                odd=nothing,
                apart=nothing,
                late=0,
                dropped=nothing,
                released=nothing,
                handed=[9] * agents,
                injected=None,
            )
        ),
    }
    return {name: len(data) for name, data in told.items()} | {"said": len(broadcasts[-1])}
