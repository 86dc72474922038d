"""Modules of a user's own: an estimator and a law that work, to be broken in one place."""

import importlib
import itertools

ESTIMATOR = """\
import sys
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from affinet import Estimate, Field, no_indicator


class Last(NamedTuple):
    measured: np.ndarray
    known: np.ndarray


@dataclass(frozen=True)
class Own:
    def channels(self, brief):
        return {"mine": {"number": Field(()), "seen": Field((), bool)}}

    def init(self, brief, batch):
        shape = (*batch, brief.relative.shape[-2])
        return Last(np.zeros((*shape, brief.dimension)), np.zeros(shape, dtype=bool))

    def sense(self, brief, state, measured, seen):
        state = Last(np.where(seen[..., None], measured, state.measured), state.known | seen)
        told = {"mine": {"number": state.measured.sum(axis=(-1, -2)), "seen": seen.any(axis=-1)}}
        return state, told

    def fuse(self, brief, state, heard, own):
        late = np.max(own.tick) >= 7
        estimate = Estimate(state.measured, state.known, brief.sensor.spread(state.measured), no_indicator(state.known))
        return state, estimate
"""

LAW = """\
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np


class Total(NamedTuple):
    force: np.ndarray


@dataclass(frozen=True)
class Own:
    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = False

    def init(self, brief, batch):
        return Total(np.zeros((*batch, brief.dimension)))

    def command(self, brief, state, tick, own, estimate, inputs):
        force = np.where(estimate.known[..., None], estimate.relative, 0.0).sum(axis=-2)
        return Total(state.force + force), -force
"""

_numbers = itertools.count()


def broken(text, *changes):
    """The text with each of these places, which it must have, replaced."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


def write(folder, text):
    """The name of a new module with this text, in a folder that is on the path."""
    name = f"own{next(_numbers)}"
    (folder / f"{name}.py").write_text(text)
    importlib.invalidate_caches()
    return name


def line_of(text, part):
    """The number of the first line that has this part."""
    return next(number for number, line in enumerate(text.splitlines(), 1) if part in line)
