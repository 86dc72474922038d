"""The network of a run as Zenoh is told of it: a hermetic star, with a name for each process, and a proof of it.

On one machine the proof is a password, and nothing listens beyond loopback; beyond it a certificate, over TLS. The medium is
the only router; everybody else is a client of it and of nothing else. A Zenoh router would carry one agent's messages to any
other that subscribes, so access control at the hub says, by default deny, who may publish and receive what.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from netem.wire import endpoints
from netem.wire.certificates import Certificates

HUB = "netem"
WORLD = "world"
CONTROL = "control"
COORDINATOR = "coordinator"
CENTRE = "centre"
DRIVER = "driver"
LOOPBACK = ("localhost", "127.0.0.1", "::1")


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
# Between machines a link breaks: it has to be noticed before TCP, which waits twice as long from try to try, comes to look only
# after many seconds. What is lost with a session is asked for again, so a process that is paused for longer loses nothing.
_LEASE_BETWEEN_MS, _OPEN_BETWEEN_MS = 3_000, 10_000
LARGEST = 2**20  # bytes that an agent may say at once, if nobody says otherwise
_BEYOND = 16  # times as much the hub drops before anybody reads it; what is between is counted, and its agent named
_ASKING = 3  # sessions of those who inject, besides one
_LARGEST_OF_ALL = 64 * 2**20  # the world's sensing of a hundred thousand agents


def agent_name(agent: int) -> str:
    """The name under which an agent logs in."""
    return f"agent-{agent}"


def host_name(host: int) -> str:
    """The name under which a process logs in that carries several agents."""
    return f"host-{host}"


def seat_name(role: str, number: int | None) -> str:
    """The name under which a process of a role logs in."""
    return role if number is None else f"{role}-{number}"


def clients(agents: Iterable[int], hosts: Mapping[int, Iterable[int]]) -> list[str]:
    """The names of all who log in at the hub; agents that a host carries do not."""
    carried = {agent for of_host in hosts.values() for agent in of_host}
    lone = [agent for agent in agents if agent not in carried]
    return [WORLD, CENTRE, CONTROL, DRIVER, *map(host_name, hosts), *map(agent_name, lone)]


def identity(name: str) -> str:
    """Which Zenoh session is that of a process: another that logs in as it may do nothing, and so each has one."""
    return name.encode().hex()


def _new_identity(name: str) -> str:
    # Whoever injects comes and goes: a session of the same id, at once after the last, got no answer three times in 300.
    return identity(name) + (secrets.token_hex(4) if name == CONTROL else "")


@dataclass(frozen=True)
class Login:
    """Where a process connects, as whom, and how it proves that: by a password, or a certificate.

    Parameters
    ----------
    endpoint
        As Zenoh has it: "unixsock-stream/PATH", "tcp/ADDRESS:PORT" on loopback, or "tls/ADDRESS:PORT".
    name
        Who it is.
    password
        On this machine alone.
    keys
        For TLS the folder that `affinet keys` made, with a certificate of this name.
    """

    endpoint: str
    name: str
    password: str = field(default="", repr=False)  # what is printed of a brief goes to a log
    keys: str | None = None

    @property
    def certificates(self) -> Certificates | None:
        """The files by which it proves who it is, if it does by files."""
        return None if self.keys is None else Certificates(self.keys, self.name)

    @property
    def is_local(self) -> bool:
        """Whether it connects within one machine."""
        return self.keys is None

    def why_refused(self) -> str | None:
        """In one line why the hub does not let it in, where TLS knows more than Zenoh says."""
        where = endpoints.address(self.endpoint)
        if self.certificates is None or where is None:
            return None
        return self.certificates.why_refused(*where)

    def check(self) -> None:
        """Go on if this may connect or listen, and will do as a proof.

        Raises
        ------
        NotTrusted
            When it would be heard beyond this machine without certificates, or these will not do.
        """
        endpoints.refuse(self.endpoint, certified=self.keys is not None)
        if (certificates := self.certificates) is not None:
            certificates.check()


def client(login: Login, patience_s: float | None = None) -> dict[str, Any]:
    """Configuration of an agent or the world: connects to the hub, and to nobody else.

    It tries for as long as `patience_s`; None for ever, where a launcher watches.

    Raises
    ------
    NotTrusted
        When it has no proof of who it is that will do there.
    """
    login.check()
    certificates = login.certificates
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
        auth=_by_password(login) if certificates is None else {},
        tls={} if certificates is None else certificates.connecting(),
    )


def listening(
    login: Login,
    dictionary_file: str | None,
    rights: Mapping[str, list[dict[str, Any]]],
    limited: list[str],
    largest: int = LARGEST,
) -> dict[str, Any]:
    """Configuration of a router that listens on one endpoint, and lets those in by name who have rights, for these alone.

    Parameters
    ----------
    login, dictionary_file
        Its own, and the file with everybody's password; None where certificates prove who they are.
    rights
        The rules of each who may log in.
    limited, largest
        Keys on which nobody is heard who says more than sixteen times the largest at once, in bytes.

    Raises
    ------
    NotTrusted
        When it would listen beyond this machine without certificates, or these will not do.
    """
    login.check()
    certificates = login.certificates
    return _config(
        {
            "mode": "router",
            "listen": {"endpoints": [login.endpoint]},
            "low_pass_filter": [_no_longer_than(_BEYOND * largest, limited)],
            "access_control": _access(rights, "usernames" if certificates is None else "cert_common_names"),
        },
        login,
        auth=_by_password(login, dictionary_file=dictionary_file) if certificates is None else {},
        tls={} if certificates is None else certificates.listening(),
        max_sessions=len(rights) + _ASKING,
    )


@contextmanager
def dictionary(passwords: Mapping[str, str]) -> Iterator[str | None]:
    """A file with these passwords as Zenoh reads it, that lies on no disk, and is gone with the block; None for none."""
    if not passwords:
        yield None
        return
    with open(os.memfd_create("passwords"), "wb") as file:
        file.write("".join(f"{name}:{password}\n" for name, password in passwords.items()).encode())
        file.flush()
        yield f"/proc/self/fd/{file.fileno()}"


def _by_password(login: Login, **known: str | None) -> dict[str, Any]:
    return {"usrpwd": {"user": login.name, "password": login.password} | known}


def _config(
    base: dict[str, Any],
    login: Login,
    auth: dict[str, Any],
    tls: dict[str, Any],
    **unicast: int,
) -> dict[str, Any]:
    lease_ms, open_ms = (_LEASE_MS, _LEASE_MS) if login.is_local else (_LEASE_BETWEEN_MS, _OPEN_BETWEEN_MS)
    times = {"open_timeout": open_ms, "accept_timeout": open_ms, "accept_pending": _PENDING}
    return base | {
        "id": _new_identity(login.name),
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "shared_memory": {"enabled": False},
            "unicast": times | unicast,
            "link": {
                "protocols": [login.endpoint.partition("/")[0]],
                "rx": {"max_message_size": _LARGEST_OF_ALL},
                "tx": {"lease": lease_ms, "queue": {"size": dict.fromkeys(_PRIORITIES, _LONGEST_QUEUE)}},
                "tls": tls,
            },
            "auth": auth,
        },
    }


def _no_longer_than(size: int, keys: list[str]) -> dict[str, Any]:
    return {"id": "size", "flows": ["ingress"], "messages": ["put", "query"], "key_exprs": keys, "size_limit": size}


def _access(rights: Mapping[str, list[dict[str, Any]]], proof: str) -> dict[str, Any]:
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for rules in rights.values() for rule in rules],
        "subjects": [
            {"id": name, proof: [name]} | ({} if name == CONTROL else {"zids": [identity(name)]}) for name in rights
        ],
        "policies": [{"rules": [rule["id"] for rule in rules], "subjects": [name]} for name, rules in rights.items()],
    }
