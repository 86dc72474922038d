"""How machines of one run meet: the keys on which their commands join the coordinator, and who of them may say what.

A seat is the place of one process in a run, by the name under which it logs in. The command that holds it joins the
coordinator, a router of its own: supervision does not travel the air that it supervises (docs/decisions/0002, 0032).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from netem.wire.rights import allow, asks, of_process
from netem.wire.session import Login, listening

BEAT = "affinet/machines/beat"  # the coordinator lives (coordinator to all)
CLOCK = "affinet/machines/clock"  # queryable: what the coordinator's clock shows


def join(seat: str) -> str:
    """Queryable: to join, saying with what (seat to coordinator)."""
    return f"affinet/machines/{seat}/join"


def up(seat: str) -> str:
    """What becomes of the processes of a seat (seat to coordinator)."""
    return f"affinet/machines/{seat}/up"


def down(seat: str) -> str:
    """What they are told (coordinator to seat)."""
    return f"affinet/machines/{seat}/down"


def alive(seat: str) -> str:
    """That a seat lives, and what its process does (seat to coordinator, lost where links break)."""
    return f"affinet/machines/{seat}/alive"


def file(seat: str) -> str:
    """Queryable: a part of a file that a process wrote on its machine (coordinator to seat)."""
    return f"affinet/machines/{seat}/file"


def here(seat: str) -> str:
    """Known for as long as the session of a seat lasts."""
    return f"affinet/machines/{seat}/here"


def seat_of(key: str) -> str:
    """Whose key this is."""
    return key.split("/")[2]


def coordinator(login: Login, seats: Iterable[str]) -> dict[str, Any]:
    """Configuration of the coordinator: it listens, and lets each seat speak for itself alone.

    Raises
    ------
    NotTrusted
        When it has no proof of who it is that will do there.
    """
    return listening(login, None, dict(map(_of_seat, seats)), [up("*"), alive("*"), join("*"), CLOCK])


def _of_seat(seat: str) -> tuple[str, list[dict[str, Any]]]:
    name, own = of_process(seat, says=[up(seat)], hears=[down(seat)], learns=[up("*")])
    return name, [
        *own,
        *asks(f"{seat}-joins", [join(seat), CLOCK]),
        allow(f"{seat}-lives", "put", "ingress", [alive(seat)]),
        allow(f"{seat}-sees", "declare_subscriber", "egress", [alive("*")]),
        allow(f"{seat}-listens", "declare_subscriber", "ingress", [BEAT]),
        allow(f"{seat}-beaten", "put", "egress", [BEAT]),
        allow(f"{seat}-here", "liveliness_token", "ingress", [here(seat)]),
        allow(f"{seat}-gives", "reply", "ingress", [file(seat)]),
        allow(f"{seat}-asked", "query", "egress", [file(seat)]),
        allow(f"{seat}-can", "declare_queryable", "ingress", [file(seat)]),
    ]
