"""Who may say and hear what in a run: a rule for each process, and by default nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from netem.core.channels import INPUT, MEASUREMENT
from netem.wire.keys import Keys, again
from netem.wire.session import (
    CENTRE,
    CONTROL,
    DRIVER,
    LARGEST,
    WORLD,
    Login,
    agent_name,
    host_name,
    listening,
)


def hub(
    login: Login,
    dictionary_file: str | None,
    keys: Keys,
    agents: Iterable[int],
    hosts: Mapping[int, Iterable[int]],
    largest: int = LARGEST,
) -> dict[str, Any]:
    """Configuration of the medium: listens on one endpoint, knows who logs in and what each of them may do.

    Parameters
    ----------
    login, dictionary_file
        Its own, and the file with everybody's password; None where certificates prove who they are.
    keys
        Those of the run.
    agents
        All agents.
    hosts
        For each process that carries several of them, which.
    largest
        What an agent may say at once, in bytes.

    Raises
    ------
    NotTrusted
        When it would listen beyond this machine without certificates, or these will not do.
    """
    limited = [keys.broadcast("*", "**"), keys.act("*"), keys.measured("*"), keys.control]
    return listening(login, dictionary_file, _rights_of_all(keys, agents, hosts), limited, largest)


def _rights_of_all(
    keys: Keys, agents: Iterable[int], hosts: Mapping[int, Iterable[int]]
) -> dict[str, list[dict[str, Any]]]:
    carried = {agent for of_host in hosts.values() for agent in of_host}
    return dict(
        [
            of_process(
                WORLD,
                says=[keys.sense, keys.command("*")],
                hears=[keys.act("*"), keys.journal, keys.measured("*")],
                learns=[keys.sense, keys.command("*")],
            ),
            *(_of_agents(agent_name(agent), keys, [agent], []) for agent in agents if agent not in carried),
            *(_of_agents(host_name(host), keys, of_host, [keys.roster(host)]) for host, of_host in hosts.items()),
            of_process(
                CENTRE,
                says=[keys.told("*")],
                hears=[keys.broadcast("*", channel) for channel in (MEASUREMENT, INPUT)],
                learns=[keys.told("*")],
            ),
            of_process(DRIVER, says=[keys.measured("*")], hears=[keys.command("*")], learns=[keys.measured("*")]),
            _controls(keys),
        ]
    )


def _of_agents(name: str, keys: Keys, agents: Iterable[int], roster: list[str]) -> tuple[str, list[dict[str, Any]]]:
    return of_process(
        name,
        says=[key for agent in agents for key in (keys.broadcast(agent, "*"), keys.act(agent))],
        hears=roster + [key for agent in agents for key in (keys.inbox(agent), keys.told(agent))],
        learns=[keys.broadcast("*", "*"), keys.act("*")],
    )


def of_process(name: str, *, says: list[str], hears: list[str], learns: list[str]) -> tuple[str, list[dict[str, Any]]]:
    """Who it is, and the rules by which it says and hears keys, and learns who hears its own."""
    return name, [
        allow(f"{name}-says", "put", "ingress", says),
        allow(f"{name}-hears", "put", "egress", hears),
        allow(f"{name}-asks", "declare_subscriber", "ingress", hears),
        # That somebody subscribes: without this a declared publisher believes that nobody listens, and sends nothing.
        allow(f"{name}-learns", "declare_subscriber", "egress", learns),
        *_repeats(f"{name}-again", hears, says, learns),
    ]


def _repeats(name: str, hears: list[str], says: list[str], learns: list[str]) -> list[dict[str, Any]]:
    """Between machines, a message that was lost is asked for again: in one question of all who speak on such a key."""
    answered = [again(key) for key in says]
    return [
        *asks(name, [again(key) for key in hears]),
        allow(f"{name}-asked", "query", "egress", [again(key) for key in learns]),
        allow(f"{name}-answers", "reply", "ingress", answered),
        allow(f"{name}-can", "declare_queryable", "ingress", answered),
    ]


def _controls(keys: Keys) -> tuple[str, list[dict[str, Any]]]:
    return CONTROL, asks(CONTROL, [keys.control])


def asks(name: str, keys: list[str]) -> list[dict[str, Any]]:
    """The rules by which it asks on keys, and hears the answers."""
    return [
        allow(f"{name}-asks", "query", "ingress", keys),
        allow(f"{name}-hears", "reply", "egress", keys),
        allow(f"{name}-learns", "declare_queryable", "egress", keys),
    ]


def allow(name: str, message: str, flow: str, keys: list[str]) -> dict[str, Any]:
    """A rule, as Zenoh has it: which message on which keys may come in (ingress) or go out (egress)."""
    return {"id": name, "permission": "allow", "messages": [message], "flows": [flow], "key_exprs": keys}
