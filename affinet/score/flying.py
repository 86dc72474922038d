"""The flights of a score, piece by piece: each can be done by another process, and what comes of it is plain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from affinet.planning import making
from affinet.planning.plan import Plan, PlanError
from affinet.planning.programs import refuse_in_process
from affinet.runtimes.rehearsing import rehearse, rehearse_all
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.score import measures
from affinet.score.card import STEPS, Task, Worsening
from affinet.score.measures import Measured

_TIMED = 5  # flights whose time is taken


class Entrant(NamedTuple):
    """An estimator, or a law, by name, or as "module:Class" of a folder."""

    key: str
    name: str
    folder: str


@dataclass(frozen=True)
class Cell:
    """An entrant in a task, through an air, with these seeds.

    Parameters
    ----------
    task
        What is flown.
    air
        Its name.
    set
        Overrides that make the air.
    entrant
        Who flies.
    seeds
        Of the draws.
    folder
        Which the scenario is relative to.
    """

    task: Task
    air: str
    set: tuple[str, ...]
    entrant: Entrant
    seeds: tuple[int, ...]
    folder: str

    def plans(self, seeds: Sequence[int], more: Sequence[str] = ()) -> list[Plan]:
        """Of its runs.

        Raises
        ------
        ScenarioError, PlanError
            When the entrant does not suit the task.
        """
        own = f'{self.entrant.key}="{self.entrant.name}"'
        plans = [self._plan((*self.set, *more, own, f"seed={seed}")) for seed in seeds]
        for plan in plans[:1]:
            refuse_in_process(plan)
        return plans

    def nobody(self, more: Sequence[str] = ()) -> Plan:
        """What is flown through the air, by whom the scenario names.

        Raises
        ------
        ScenarioError, PlanError
            When the task cannot be flown through it.
        """
        return self._plan((*self.set, *more))

    def asks_for(self) -> tuple[bool, bool]:
        """Whether the task is for agents to find out where they are, and whether it is to pursue a target."""
        plan = self._plan(())
        return plan.localizes, plan.pursues

    def _plan(self, overrides: Sequence[str]) -> Plan:
        name = self.task.scenario
        scenario = str(Path(self.folder) / name) if name.endswith(".toml") else name
        every = (*self.task.set, *overrides, "record.enabled=false")
        return making.make(loading.load(scenario, every, Path(self.entrant.folder)))


@dataclass(frozen=True)
class Descent:
    """An entrant in a task, for which something is made worse until each swarm is lost."""

    cell: Cell
    worsening: Worsening


class Flown(NamedTuple):
    """What came of a cell: of each run what is measured; or why the entrant does not suit the task, or the air."""

    runs: dict[str, list[float]]
    unsuited: str | None


class Timed(NamedTuple):
    """Of an entrant in a task: time of the processor in a tick, in seconds, and what each agent says in a second."""

    tick_s: float
    messages: float
    bytes: float


def cell(given: Cell) -> Flown:
    """Fly a cell.

    Raises
    ------
    ScenarioError, PlanError
        When the task cannot be flown through this air, whoever flies.
    """
    if (why := unsuited(given)) is not None:
        return Flown({}, why)
    plans = _suited(given, given.seeds)
    if isinstance(plans, str):
        return Flown({}, plans)
    found = [measures.of(run, given.task) for run in rehearse_all(plans)]
    return Flown({name: [float(getattr(one, name)) for one in found] for name in Measured._fields}, None)


def descent(given: Descent) -> list[float]:
    """How bad it has to be for the swarm of each seed to be lost, by bisection.

    Infinite where it is not lost at the worst, and the least where it is at all that is tried. Nothing of an entrant that
    does not suit the task, or what is made worse.

    Draws are the same however bad it is: a run at a higher loss loses what one at a lower one does, and more.
    """
    if unsuited(given.cell) is not None:
        return []  # the cells of the same task say why
    seeds, worse = given.cell.seeds, given.worsening
    if isinstance(_suited(given.cell, seeds[:1], worse.at(worse.most)), str):
        return []
    low, high = np.full(len(seeds), worse.least), np.full(len(seeds), worse.most)
    survived = ~_lost(given, seeds, high.tolist())
    for _ in range(STEPS):
        middle = worse.between(low, high)
        gone = _lost(given, seeds, middle.tolist())
        low, high = np.where(gone, low, middle), np.where(gone, middle, high)
    between = np.where(low > worse.least, worse.between(low, high), worse.least)
    return [float(one) for one in np.where(survived, np.inf, between)]


def timed(given: Cell) -> Timed | None:
    """Take the time of flights of one run of a cell; others on the machine make it longer, so the median counts.

    None of an entrant that does not suit the task.
    """
    if unsuited(given) is not None:
        return None
    (plan,) = given.plans(given.seeds[:1])
    rehearse(plan)  # kernels are compiled
    took = [rehearse(plan).outcome.wall_s for _ in range(_TIMED)]
    said = measures.load_of(plan)
    return Timed(median(took) / plan.world.ticks, said.messages, said.bytes)


def unsuited(given: Cell) -> str | None:
    """Why the entrant does not suit the task, whatever the air; None where it does."""
    try:
        (plan,) = replace(given, set=()).plans(given.seeds[:1])
    except (ScenarioError, PlanError) as error:
        return str(error)
    if (plan.localizes, plan.pursues) == given.asks_for():
        return None
    return "what it reports is not what the task is about: places of agents, a target, or neither"


def _suited(given: Cell, seeds: Sequence[int], more: Sequence[str] = ()) -> list[Plan] | str:
    """The plans of an entrant that suits the task; or why it does not suit the air, through which others can fly."""
    try:
        return given.plans(seeds, more)
    except (ScenarioError, PlanError) as error:
        given.nobody(more)
        return str(error)


def _lost(given: Descent, seeds: Sequence[int], worse: Sequence[float]) -> Any:
    plans = [
        plan
        for seed, bad in zip(seeds, worse, strict=True)
        for plan in given.cell.plans([seed], given.worsening.at(bad))
    ]
    return np.array([measures.of(run, given.cell.task).lost for run in rehearse_all(plans)])
