"""Where a hub listens: what may stand there, and what is heard beyond this machine."""

from __future__ import annotations

import ipaddress
import re
import socket

from netem.core.refusal import Refusal
from netem.wire.certificates import NotTrusted

SOCKET = "unixsock-stream/"  # and the path of a file
_LAST_PORT = 65535
_ADDRESS = re.compile(r"(tcp|tls)/(?:\[([0-9A-Fa-f:.]+)\]|([^\[\]:/?#]+)):([0-9]+)")


class CannotListen(Refusal, ValueError):
    """Where others were to find a process it cannot listen: why, in one line."""


def address(endpoint: str) -> tuple[str, int] | None:
    """Host and port of an endpoint; None where it is no such address."""
    parts = _ADDRESS.fullmatch(endpoint)
    return (parts[2] or parts[3], int(parts[4])) if parts and int(parts[4]) <= _LAST_PORT else None


def over_machines(endpoint: str) -> tuple[str, int]:
    """Host and port of an endpoint at which others find a machine.

    Raises
    ------
    NotTrusted
        When it is none.
    """
    where = address(endpoint)
    if where is None or not endpoint.startswith("tls/"):
        raise NotTrusted(f"{endpoint!r} is no address for several machines: write tls/ADDRESS:PORT")
    return where


def listening(endpoint: str) -> tuple[str, int]:
    """Host and port of an endpoint at which this machine can be found by others: nothing listens there, and something may.

    Raises
    ------
    NotTrusted
        When it is none.
    CannotListen
        When this machine cannot listen there.
    """
    host, port = over_machines(endpoint)
    try:
        (family, kind, *_, where), *_ = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        with socket.socket(family, kind) as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            tried.bind(where)
            tried.listen()
    except OSError as error:
        raise CannotListen(f"{endpoint}: this machine cannot listen there: {error.strerror}") from error
    return host, port


def refuse(endpoint: str, *, certified: bool) -> None:
    """Go on if a process may connect or listen there.

    Parameters
    ----------
    endpoint
        As Zenoh has it.
    certified
        Whether it has certificates.

    Raises
    ------
    NotTrusted
        When it would be heard beyond this machine without certificates, or is no such place.
    """
    if endpoint.startswith(SOCKET) and not certified:
        return
    if (where := address(endpoint)) is None:
        raise NotTrusted(f"{endpoint}: write it as tls/ADDRESS:PORT, or tcp/127.0.0.1:PORT on this machine")
    over_tls = endpoint.startswith("tls/")
    if not over_tls and not _is_loopback(where[0]):
        raise NotTrusted(
            f"{endpoint}: it would be heard beyond this machine, where nobody is known by a password: "
            f"make certificates with `affinet keys`, and write tls/ for tcp/"
        )
    if over_tls != certified:
        raise NotTrusted(f"{endpoint}: TLS needs the folder that `affinet keys` made, and nothing else does")


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
