"""The network of a run as Zenoh is told of it: a hermetic star on loopback, with a name and a password for each process.

The medium is the only router; everybody else is a client of it and of nothing else. A Zenoh router would carry one agent's
messages to any other that subscribes, so access control at the hub says, by default deny, who may publish and receive what.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from netem.core.channels import INPUT, MEASUREMENT
from netem.wire.keys import Keys

HUB = "netem"
WORLD = "world"
CONTROL = "control"
CENTRE = "centre"


# One worker thread per process: with the default eleven, a tick of ten agents takes a quarter longer on two cores.
_RUNTIME = "tx: (handover: app), acc: (handover: app), net: (handover: app), app: (worker_threads: 1)"
ENVIRONMENT = {"ZENOH_RUNTIME": f"(rx: (handover: app), {_RUNTIME})", "OPENBLAS_NUM_THREADS": "1"}
# The hub passes on what it receives while it receives: as one thread it would wait for itself as soon as more is to be sent on
# than its queue holds, like a message of a mebibyte.
HUB_ENVIRONMENT = {"ZENOH_RUNTIME": f"(rx: (worker_threads: 1), {_RUNTIME})"}

_PRIORITIES = (
    "control",
    "real_time",
    "interactive_high",
    "interactive_low",
    "data_high",
    "data",
    "data_low",
    "background",
)
_LONGEST_QUEUE = 16
_PENDING = 10_000
# A paused process must not lose its session: who is silent too long is for the run to notice, not for Zenoh. Nor must a hundred
# that log in at once on two cores.
_LEASE_MS = 3_600_000


_PLACES = ("/tmp", "/var/tmp", "/dev/shm")  # where the user's own temporary folder will not do
_PLAIN_PATH = re.compile(r"[A-Za-z0-9/._+-]+")  # an endpoint is a grammar of its own, in which '?' and '#' part it
_LONGEST_SOCKET, _SOCKET = 107, "/affinet-12345678/z.sock"


def socket_folder() -> str:
    """A temporary folder in which the path of a socket is short enough for the system and plain enough for an endpoint.

    Raises
    ------
    OSError
        When there is none.
    """
    own = tempfile.gettempdir()
    for folder in (own, *_PLACES):
        fits = len(folder) + len(_SOCKET) <= _LONGEST_SOCKET and _PLAIN_PATH.fullmatch(folder)
        if fits and os.access(folder, os.W_OK | os.X_OK):
            return folder
    raise OSError(
        f"{own!r} is too long or too odd a path for the run's socket, and {', '.join(_PLACES)} cannot be written to; "
        f"set TMPDIR to a plain path of at most {_LONGEST_SOCKET - len(_SOCKET)} characters"
    )


def agent_name(agent: int) -> str:
    """The name under which an agent logs in."""
    return f"agent-{agent}"


def host_name(host: int) -> str:
    """The name under which a process logs in that carries several agents."""
    return f"host-{host}"


@dataclass(frozen=True)
class Login:
    """Where a process connects, and as whom."""

    endpoint: str
    name: str
    password: str


def client(login: Login, patience_s: float | None = None) -> dict[str, Any]:
    """Configuration of an agent or the world: connects to the hub, and to nobody else.

    It tries for as long as `patience_s`; None for ever, where a launcher watches.
    """
    return _config(
        {
            "mode": "client",
            "connect": {
                "endpoints": [login.endpoint],
                "timeout_ms": -1 if patience_s is None else round(1000 * patience_s),
                "exit_on_failure": True,
                "retry": {"period_init_ms": 10, "period_max_ms": 50, "period_increase_factor": 1.5},
            },
        },
        login,
    )


def hub(
    login: Login, dictionary_file: str, keys: Keys, agents: Iterable[int], hosts: Mapping[int, Iterable[int]]
) -> dict[str, Any]:
    """Configuration of the medium: listens on one endpoint, knows the logins and what each of them may do.

    Parameters
    ----------
    login, dictionary_file
        Its own, and the file with everybody's password.
    keys
        Those of the run.
    agents
        All agents.
    hosts
        For each process that carries several of them, which.
    """
    return _config(
        {
            "mode": "router",
            "listen": {"endpoints": [login.endpoint]},
            "access_control": _access(keys, agents, hosts),
        },
        login,
        dictionary_file=dictionary_file,
    )


def _config(base: dict[str, Any], login: Login, **auth: str) -> dict[str, Any]:
    return base | {
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "shared_memory": {"enabled": False},
            "unicast": {"open_timeout": _LEASE_MS, "accept_timeout": _LEASE_MS, "accept_pending": _PENDING},
            "link": {"tx": {"lease": _LEASE_MS, "queue": {"size": dict.fromkeys(_PRIORITIES, _LONGEST_QUEUE)}}},
            "auth": {"usrpwd": {"user": login.name, "password": login.password} | auth},
        },
    }


def _access(keys: Keys, agents: Iterable[int], hosts: Mapping[int, Iterable[int]]) -> dict[str, Any]:
    carried = {agent for of_host in hosts.values() for agent in of_host}
    rights = [
        _rights(WORLD, says=[keys.sense], hears=[keys.act("*"), keys.journal], learns=[keys.sense]),
        *(_of_agents(agent_name(agent), keys, [agent], []) for agent in agents if agent not in carried),
        *(_of_agents(host_name(host), keys, of_host, [keys.roster(host)]) for host, of_host in hosts.items()),
        _rights(
            CENTRE,
            says=[keys.told("*")],
            hears=[keys.broadcast("*", channel) for channel in (MEASUREMENT, INPUT)],
            learns=[keys.told("*")],
        ),
        _controls(keys),
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for _, rules in rights for rule in rules],
        "subjects": [{"id": name, "usernames": [name]} for name, _ in rights],
        "policies": [{"rules": [rule["id"] for rule in rules], "subjects": [name]} for name, rules in rights],
    }


def _of_agents(name: str, keys: Keys, agents: Iterable[int], roster: list[str]) -> tuple[str, list[dict[str, Any]]]:
    return _rights(
        name,
        says=[key for agent in agents for key in (keys.broadcast(agent, "*"), keys.act(agent))],
        hears=roster + [key for agent in agents for key in (keys.inbox(agent), keys.told(agent))],
        learns=[keys.broadcast("*", "*"), keys.act("*")],
    )


def _rights(name: str, *, says: list[str], hears: list[str], learns: list[str]) -> tuple[str, list[dict[str, Any]]]:
    return name, [
        _allow(f"{name}-says", "put", "ingress", says),
        _allow(f"{name}-hears", "put", "egress", hears),
        _allow(f"{name}-asks", "declare_subscriber", "ingress", hears),
        # That somebody subscribes: without this a declared publisher believes that nobody listens, and sends nothing.
        _allow(f"{name}-learns", "declare_subscriber", "egress", learns),
    ]


def _controls(keys: Keys) -> tuple[str, list[dict[str, Any]]]:
    return CONTROL, [
        _allow("control-asks", "query", "ingress", [keys.control]),
        _allow("control-hears", "reply", "egress", [keys.control]),
        _allow("control-learns", "declare_queryable", "egress", [keys.control]),
    ]


def _allow(name: str, message: str, flow: str, keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "messages": [message], "flows": [flow], "key_exprs": keys}
