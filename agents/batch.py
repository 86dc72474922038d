"""Agents that live as one batch, of whom not all take part in every tick."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from agents.agent import Agent, AgentState
from analysis.models.arrays import Integers, Mask, chosen
from netem.loading.given import protect


def beside_others(state: AgentState, idle: Mask, tick: int) -> AgentState:
    """The states (N,) with which all live a tick, those who are idle (N,) too: `put_back` undoes what comes of it.

    They must not catch up for that.
    """
    return state._replace(sensed=np.where(idle, tick - 1, state.sensed))


def put_back(idle: Mask, before: AgentState, after: AgentState) -> AgentState:
    """The states (N,) after a tick, of those who were idle (N,) as before it."""
    state: AgentState = chosen(idle, before, after)
    protect(state)
    return state


def come_back(
    agents: Agent, numbers: Integers, state: AgentState, restarted: Collection[int], remembering: Collection[int]
) -> AgentState:
    """The states (N,) once some were restarted: those who remember go on from their own, the others know nothing.

    Parameters
    ----------
    agents, numbers
        The batch, and the number of each agent in it, shape (N,).
    state
        What they remembered when they were killed.
    restarted, remembering
        Numbers of those who come back, and of those among them who remember.
    """
    forgetful = set(restarted).difference(remembering)
    for who, new in ((forgetful, agents.init(numbers.shape)), (remembering, agents.revived(state))):
        state = chosen(np.isin(numbers, [*who]), new, state)
    protect(state)
    return state
