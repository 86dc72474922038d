"""Scenario -> when each agent wakes in a run in real time."""

from __future__ import annotations

from affinet.scenario import selectors
from affinet.scenario.real_time import TimerSetting
from affinet.scenario.sections import Scenario
from affinet.scenario.selectors import ChoiceKey
from affinet.scenario.wrong import ScenarioError, said_at
from agents.timer import Timer
from netem.core.pace import Pace
from world.formation.nominal import Formation

_FIRST_ENTRY = 2**31  # no entry of a timeline has such a number, by which random choices are drawn


def of(given: Scenario, formation: Formation) -> tuple[Timer, ...]:
    """The timers of all agents; none of a run in lockstep.

    Raises
    ------
    ScenarioError
        When one names an agent that does not exist, or agents of one process would wake apart.
    """
    if given.time.mode == "lockstep":
        return ()
    settings = [TimerSetting()] * formation.agents
    for number, setting in enumerate(given.time.real.timers):
        with said_at(f"time.real.timers[{number}].agents"):
            whom = selectors.agents(setting.agents, formation, ChoiceKey(given.seed, _FIRST_ENTRY + number))
        for agent in whom:
            settings[agent - 1] = setting
    if given.agents.per_process > 1 and any(one != settings[0] for one in settings):
        raise ScenarioError(
            "time.real.timers: agents of one process wake together; give all the same, or leave agents.per_process at 1"
        )
    dt, factor = given.time.dt, given.time.real.factor
    return tuple(
        Timer(dt / one.rate, dt * one.phase, dt * one.jitter, one.drift, dt * one.listens, factor, given.seed, agent)
        for agent, one in enumerate(settings, 1)
    )


def pace(given: Scenario) -> Pace | None:
    """How time goes in a run in real time; None in lockstep."""
    if given.time.mode == "lockstep":
        return None
    return Pace(given.time.dt, given.time.real.factor, given.time.real.late)
