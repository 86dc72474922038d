"""Agents as a process (`python -m agents`): one, or several that a host carries as one batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

from agents.node import AgentBrief, AgentsNode, HostBrief
from agents.real_time import RealTimeAgentsNode
from netem.processes.leaving import leave, status_of
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session
from netem.wire.repeating import opened
from netem.wire.session import client


def main() -> NoReturn:
    """Fly one agent until the run is over; the process ends here, whatever threads the user's own code has started."""
    leave(status_of(lambda: _fly(Supervisor())))


def host() -> NoReturn:
    """Fly the agents of a host."""
    leave(status_of(lambda: _carry(Supervisor())))


def _fly(supervisor: Supervisor) -> None:
    brief = supervisor.brief(AgentBrief)
    with supervisor.confessing(), _session(supervisor, brief) as session:
        _until_the_end(supervisor, node_of(session, supervisor, [brief], None))


def _carry(supervisor: Supervisor) -> None:
    brief = supervisor.brief(HostBrief)
    with supervisor.confessing(), _session(supervisor, brief.agents[0]) as session:
        _until_the_end(supervisor, node_of(session, supervisor, brief.agents, brief.host))


def _session(supervisor: Supervisor, brief: AgentBrief) -> Session:
    return opened(client(brief.login), brief.login, supervisor.lost, in_real_time=brief.timer is not None)


def node_of(session: Session, supervisor: Supervisor, briefs: Sequence[AgentBrief], host: int | None) -> AgentsNode:
    """The agents of a process: in lockstep, or in real time."""
    of_time = AgentsNode if briefs[0].timer is None else RealTimeAgentsNode
    return of_time(session, supervisor, briefs, host)


def _until_the_end(supervisor: Supervisor, node: AgentsNode) -> None:
    node.await_everybody()
    supervisor.tell("ready")
    node.run()
    supervisor.tell("done")
