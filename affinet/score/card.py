"""A scorecard: which tasks are flown through which airs, and what is made worse and worse until swarms are lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from affinet.scenario import files
from affinet.scenario.explain import explained
from affinet.scenario.keys import key
from affinet.scenario.section import Section
from affinet.scenario.source import Source
from affinet.scenario.units import NotNegative, Positive
from affinet.scenario.wrong import ScenarioError
from analysis.models import elementary
from analysis.models.arrays import Array

STEPS = 6  # halvings of the range in which a break-down point lies

FOLDER = "scorecards"
_Count = Annotated[int, Field(ge=2)]


class Task(Section):
    """A scenario to be flown, and when its swarm is lost."""

    name: str = key(..., "of the task")
    says: str = key(..., "what it is, in words")
    scenario: str = key(..., "what is flown: the name of one that is shipped, or a file")
    set: list[str] = key(list, "overrides, like time.dt=0.05")
    lost: Positive = key(..., "beyond which error at the end a swarm is lost", "m")
    recovered: Positive = key(..., "below which error it has recovered", "m")
    noisier: list[str] = key(list, "overrides that make its sensors worse: whoever measures has to do worse")
    rivals: list[str] = key(list, "estimators to compare with, where none are named")
    quick_rivals: list[str] = key(list, "those of the quick form, if others")
    laws: list[str] = key(list, "laws to compare with, where none are named")
    quick: bool = key(False, "whether it is flown in the quick form")

    @model_validator(mode="after")
    def _recovers(self) -> Task:
        if self.recovered > self.lost:
            raise ValueError("recovered: a swarm that is lost has not recovered: give no more than lost")
        return self

    def quickly(self) -> Task:
        """Against fewer, where it says so."""
        return self.model_copy(update={"rivals": self.quick_rivals or self.rivals})


class Air(Section):
    """What links do to messages, or what befalls the swarm."""

    name: str = key(..., "of the air")
    says: str = key(..., "what it is, in words")
    set: list[str] = key(list, "overrides, like network.availability=0.5")
    quick: bool = key(False, "whether it is flown in the quick form")


class Worsening(Section):
    """Something that is made worse, run by run, until the swarm is lost: its break-down point is where half of them are."""

    name: str = key(..., "of what is made worse")
    says: str = key(..., "what it is, in words")
    unit: str = key("", "of how bad it is")
    set: list[str] = key(..., "overrides, with {x} for how bad it is, and {rest} for one less that")
    least: NotNegative = key(0.0, "how bad it is at the best; above 0 it is looked for by factors, and else by halves")
    most: Positive = key(..., "how bad it is at the worst")
    quick: bool = key(False, "whether it is flown in the quick form")

    def between(self, better: Array, worse: Array) -> Array:
        """How bad it is half way between."""
        return np.sqrt(better * worse) if self.least > 0.0 else (better + worse) / 2.0

    @property
    def least_tried(self) -> float:
        """How bad it is at the best of what is tried."""
        tried = np.array(self.most)
        for _ in range(STEPS):
            tried = self.between(np.array(self.least), tried)
        return float(tried)

    def around(self, found: float) -> tuple[float, float]:
        """Between which values one lies that bisection has found."""
        if not np.isfinite(found):
            return found, found
        if found <= self.least:
            return self.least, self.least_tried
        parts = float(1 << (STEPS + 1))
        if self.least == 0.0:
            return found - self.most / parts, found + self.most / parts
        factor = float(elementary.power(self.most / self.least, 1.0 / parts))
        return found / factor, found * factor

    def at(self, worse: float) -> list[str]:
        """The overrides that make it so bad."""
        return [one.replace("{x}", f"{worse:.9g}").replace("{rest}", f"{1.0 - worse:.9g}") for one in self.set]

    @model_validator(mode="after")
    def _worsens(self) -> Worsening:
        if not any("{x}" in one or "{rest}" in one for one in self.set):
            raise ValueError("set: no override has {x} or {rest}: it would be as bad in every run")
        if self.least >= self.most:
            raise ValueError("least: give less than most")
        return self


class Scorecard(Section):
    """What is flown for a score."""

    title: str = key(..., "of the card")
    seeds: _Count = key(..., "runs of each estimator, task and air")
    quick_seeds: _Count = key(..., "in the quick form")
    tasks: list[Task] = key(..., "what is flown")
    airs: list[Air] = key(..., "through what")
    worsenings: list[Worsening] = key(list, "what is made worse and worse")

    _folder: Path = PrivateAttr(default=Path())

    @property
    def folder(self) -> Path:
        """Which its scenarios are relative to."""
        return self._folder

    @model_validator(mode="after")
    def _apart(self) -> Scorecard:
        groups: Mapping[str, Sequence[Task | Air | Worsening]] = {
            "tasks": self.tasks,
            "airs": self.airs,
            "worsenings": self.worsenings,
        }
        for group, entries in groups.items():
            names = [entry.name for entry in entries]
            if group != "worsenings" and not any(entry.quick for entry in entries):
                raise ValueError(f"{group}: give one quick = true at least")
            if twice := [name for name in names if names.count(name) > 1]:
                raise ValueError(f"{group}: {twice[0]!r} stands there twice")
        return self

    def quickly(self) -> Scorecard:
        """Its quick form."""
        return self.model_copy(
            update={
                "seeds": self.quick_seeds,
                "tasks": [
                    task.model_copy(update={"rivals": task.quick_rivals or task.rivals})
                    for task in self.tasks
                    if task.quick
                ],
                "airs": [air for air in self.airs if air.quick],
                "worsenings": [one for one in self.worsenings if one.quick],
            }
        )


def load(name: str) -> Scorecard:
    """The scorecard of a file, or the one that is shipped under this name.

    Raises
    ------
    ScenarioError
        When there is none, or something in it is wrong: in which key.
    """
    read = files.read(name, FOLDER, "scorecard")
    try:
        card = Scorecard.model_validate(read.says)
    except ValidationError as error:
        raise ScenarioError(explained(error, Scorecard, Source(read.name, read.text, ()))) from None
    card._folder = read.folder
    return card
