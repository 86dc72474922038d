"""What a process of a run is told of a plan."""

from __future__ import annotations

from affinet.planning.plan import Plan
from agents.node import AgentBrief
from netem.wire.session import Login


def agent_brief(
    plan: Plan,
    run: str,
    login: Login,
    number: int,
    *,
    checkpoint: str | None = None,
    remembers: bool = False,
    clock_s: float = 0.0,
) -> AgentBrief:
    """All that one agent of a plan is told.

    Parameters
    ----------
    plan, run, login
        What is flown, under which name, and as whom its process connects.
    number
        Which agent it is, from 1.
    checkpoint, remembers
        The file that keeps its state, if one is wanted, and whether it goes on from what is in there.
    clock_s
        How much the medium's clock shows more than that of its machine, in seconds.
    """
    row = number - 1
    return AgentBrief(
        run=run,
        login=login,
        agent=number,
        neighbours=plan.world.links.neighbours_of(number),
        estimator=plan.estimator,
        law=plan.law,
        leaders=plan.scenario.agents.leaders,
        leader_gain=plan.scenario.agents.leader_gain,
        limit=plan.scenario.agents.limit,
        reports=plan.reports,
        brief=plan.brief_of(row),
        hears_centre=plan.centre is not None,
        checkpoint=checkpoint,
        remembers=remembers,
        timer=plan.timers[row] if plan.timers else None,
        clock_s=clock_s,
    )
