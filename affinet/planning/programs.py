"""What needs processes: agents that fly by programs of a user's own, and runs in real time; and what cannot have them."""

from __future__ import annotations

from collections.abc import Mapping

from affinet.planning.plan import Plan, PlanError
from affinet.scenario.wrong import ScenarioError
from analysis.models.finding import Finding
from netem.core.listing import listed
from netem.loading import modules


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
    """Refuse to fly in one process what needs several.

    Raises
    ------
    ScenarioError
        When it is to fly in real time.
    PlanError
        When programs fly some of it.
    """
    if plan.pace is not None:
        raise ScenarioError(
            "time.mode: a run in real time flies over processes (--runtime processes); in one process set it to 'lockstep'"
        )
    if plan.scenario.world == "external":
        raise ScenarioError(
            "world: robots outside are flown over processes (--runtime processes); in one process leave it 'simulated'"
        )
    if plan.programs:
        says = (
            f"agents {listed(plan.programs)} fly by programs of your own, each of them a process: fly over processes "
            "(`affinet run` does, or --affinet-runtime=processes), or without agents.programs"
        )
        raise PlanError([Finding("programs", "error", says)])


def refuse_over_processes(plan: Plan) -> None:
    """Refuse to fly over processes what none but this one has.

    Raises
    ------
    PlanError
        When estimator or law are of the script or notebook that runs.
    """
    if here := [choice.path for choice in (plan.estimator, plan.law) if modules.is_running(choice.path)]:
        says = (
            f"{listed(here)} is of the script or notebook that runs, which no other process has: write its class to a "
            "module (my_module.py), and import it from there, or fly in one process"
        )
        raise PlanError([Finding("processes", "error", says)])
