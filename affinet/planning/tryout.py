"""One tick in silence: what law and estimator want of each other, and what they do wrong, shows before anything starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from affinet.scenario.wrong import ScenarioError
from agents.agent import Agent, AgentAction
from agents.brief import Brief
from agents.centre.checked import CheckedCentre
from agents.estimators.base import CentreEstimate
from agents.exchange import Heard
from analysis.models.arrays import Mask
from analysis.models.pursuit import Sighting
from netem.core import channels
from world.books.history import TAKEN, file_of

_LONGEST_NAME, _LONGEST_FILE = 100, 255


def silent_tick(agents: Agent, centre: CheckedCentre | None) -> Mapping[str, tuple[int, ...]]:
    """All agents as one batch, as in process: what they report, and the shape of each for one agent.

    The centre has its tick too, where there is one.

    Raises
    ------
    UserCodeError
        When estimator or law fail, or return what they should not.
    ScenarioError
        When a report has a name that every run has already.
    """
    batch = agents.brief.present.shape[:1]
    action = _tick(agents, batch, None if centre is None else _told(centre, agents.brief), positioned=True)
    reports = {name: said.shape[len(batch) :] for name, said in action.estimate.reports.items()}
    if taken := sorted(reports.keys() & TAKEN):
        said = f"the estimator reports {', '.join(taken)}, which every run has already: give it another name"
        raise ScenarioError(f"agents: {said}")
    place = (agents.brief.dimension,)
    if reports.get(channels.PLACE, place) != place:
        said = f"where an agent believes it is, (..., {place[0]}), not {reports[channels.PLACE]}: give it another name"
        raise ScenarioError(f"agents: the estimator reports {channels.PLACE!r}, which is {said}")
    if long := [name for name in reports if len(name) > _LONGEST_NAME or len(file_of(name)) > _LONGEST_FILE]:
        most = f"at most {_LONGEST_NAME}, a third of that where they are not plain"
        raise ScenarioError(f"agents: a report has a name of {len(long[0])} letters: give it {most}")
    return reports


def alone(agent: Callable[[int], Agent], positioned: Mask, told_mission: Mask, centre: CheckedCentre | None) -> None:
    """One agent of each kind by itself, as in a process of its own: with no leading axes, and no more than it is told.

    Parameters
    ----------
    agent
        Makes the agent of a row.
    positioned, told_mission
        Who is told where it is, and the manoeuvre, shape (N,).
    centre
        The filter that hears everybody, if there is one.

    Raises
    ------
    UserCodeError
        When estimator or law fail, or return what they should not.
    """
    _, firsts = np.unique(np.stack([positioned, told_mission]), axis=1, return_index=True)
    for row in sorted(firsts.tolist()):
        one = agent(row)
        _tick(one, (), None if centre is None else _nothing_told(one.brief), positioned=bool(positioned[row]))


def _told(centre: CheckedCentre, brief: Brief) -> Heard:
    """What the centre of all these agents tells when nothing is measured."""
    still = np.zeros_like(brief.nominal)
    _, told = centre.step(centre.begin(()), np.zeros_like(brief.relative), np.zeros_like(brief.present), still)
    return Heard(told._asdict(), brief.present)


def _nothing_told(brief: Brief) -> Heard:
    unseen = np.zeros_like(brief.relative)
    told = CentreEstimate(unseen, np.zeros((*unseen.shape, brief.dimension)), np.full(brief.present.shape, np.nan))
    return Heard(told._asdict(), brief.present)


def _tick(agents: Agent, batch: tuple[int, ...], told: Heard | None, *, positioned: bool) -> AgentAction:
    brief = agents.brief
    nowhere, nobody = np.zeros_like(brief.nominal), np.zeros_like(brief.present)
    motion = np.repeat(nowhere[..., None, :], agents.law.order - 1, axis=-2) if agents.law.order > 1 else None
    state, _ = agents.sense(agents.init(batch), 0, np.zeros_like(brief.relative), nobody, motion)
    silence = {
        channel: Heard(
            {name: np.zeros((*nobody.shape, *f.shape), dtype=f.dtype) for name, f in fields.items()},
            nobody,
            np.zeros(nobody.shape, dtype=np.int64),
        )
        for channel, fields in agents.channels().items()
    }
    sighting = None
    if brief.target is not None:
        sighting = Sighting(nowhere, np.zeros(batch, dtype=bool), *np.zeros((2, *batch), dtype=np.int64))
    heard = silence if told is None else {**silence, channels.CENTRE: told}
    _, action = agents.act(state, 0, heard, nowhere if positioned else None, motion, sighting)
    return action
