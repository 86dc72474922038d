"""Agents that fly by programs of a user's own, in place of ours: there have to be such agents, and processes."""

from __future__ import annotations

from collections.abc import Mapping

from affinet.planning.plan import Plan, PlanError
from affinet.scenario.sections import ScenarioError
from analysis.models.finding import Finding
from netem.core.listing import listed


def refuse_strangers(programs: Mapping[str, str], agents: int) -> None:
    """Refuse programs of agents that are none.

    Raises
    ------
    ScenarioError
        Naming the key.
    """
    for number in programs:
        if not 1 <= int(number) <= agents:
            raise ScenarioError(f"agents.programs.{number}: there is no agent {number}; they are 1 to {agents}")


def refuse_in_process(plan: Plan) -> None:
    """Refuse to fly in one process what programs have to.

    Raises
    ------
    PlanError
        When the plan has some.
    """
    if plan.programs:
        says = (
            f"agents {listed(plan.programs)} fly by programs of your own, each of them a process: fly over processes "
            "(`affinet run` does, or --affinet-runtime=processes), or without agents.programs"
        )
        raise PlanError([Finding("programs", "error", says)])
