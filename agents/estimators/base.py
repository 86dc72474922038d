"""What an estimator is.

A frozen dataclass of its parameters, with three pure methods over arrays with any leading axes. What it remembers between
ticks is a state, a NamedTuple of arrays that all begin with those axes. To add one, write a file like `rkf.py`, and name
it in the entry-point group `affinet.estimators` of your own package, or in a scenario as "module:Class".
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from agents.brief import Array, Brief, Mask, Own
from agents.estimators.small import triangle

State = TypeVar("State")
Fields = Mapping[str, Any]


class Field(NamedTuple):
    """A broadcast field: its shape, () for one value, and whether it holds numbers or truths."""

    shape: tuple[int, ...]
    dtype: type = float


Channels = Mapping[str, Mapping[str, Field]]


class Heard(NamedTuple):
    """What arrived on one channel.

    Parameters
    ----------
    fields
        Each broadcast field, gathered over the neighbours: shape (..., n, *field); anything where nothing arrived.
    fresh
        From which neighbours a message arrived in this tick, shape (..., n).
    """

    fields: Fields
    fresh: Mask


class Estimate(NamedTuple):
    """What an agent believes of its neighbours.

    Parameters
    ----------
    relative
        Relative positions zhat_ij, shape (..., n, D), in metres; 0 where not known.
    known
        Where there is an estimate at all, shape (..., n).
    covariance
        Of the relative positions, shape (..., n, D, D), in square metres; of no meaning where not known.
    psi
        Convergence indicator (paper 000, eq. 16), shape (...), in square units of Theta; NaN where undefined.
    relative_velocity
        Estimated relative velocities, shape (..., n, D), in metres per second, by estimators that track them.
    feasible
        Whether the neighbours seen in this tick determine a local map, shape (...), by estimators that fit one.
    reports
        What else an estimator has to say, for recordings, metrics and control laws: named arrays, each of one shape (..., *).
    """

    relative: Array
    known: Mask
    covariance: Array
    psi: Array
    relative_velocity: Array | None = None
    feasible: Mask | None = None
    reports: Mapping[str, Array] = MappingProxyType({})

    @property
    def spread(self) -> Array:
        """Upper triangles of the covariances, row by row, shape (..., n, D (D + 1) / 2); 0 where not known."""
        return np.where(self.known[..., None], triangle(self.covariance), 0.0)


class Estimator(Protocol[State]):
    """An estimator of relative positions."""

    def channels(self, brief: Brief) -> Channels:
        """What it broadcasts: for each channel, its fields; what is for one neighbour stands in that neighbour's slot."""

    def init(self, brief: Brief, batch: tuple[int, ...]) -> State:
        """The state before the first tick, with `batch` as its leading axes."""

    def sense(self, brief: Brief, state: State, measured: Array, seen: Mask) -> tuple[State, Mapping[str, Fields]]:
        """Take in the measurements y_ij (..., n, D) of the edges `seen` (..., n); say what to broadcast on each channel."""

    def fuse(self, brief: Brief, state: State, heard: Mapping[str, Heard], own: Own) -> tuple[State, Estimate]:
        """Take in what the neighbours broadcast, and estimate; `own` is what the agent itself flew from the tick before."""


def no_edges(slots: Mask, dimension: int, reports: Mapping[str, Array]) -> Estimate:
    """What an agent has to say that estimates no relative position in any of its slots, (..., n)."""
    relative = np.zeros((*slots.shape, dimension))
    covariance = np.zeros((*slots.shape, dimension, dimension))
    return Estimate(relative, np.zeros_like(slots), covariance, no_indicator(slots), reports=reports)


def no_indicator(known: Mask) -> Array:
    """The psi of an estimator that has none: NaN, shape (...)."""
    return np.full(known.shape[:-1], np.nan)


def refuse_negative(**deviations: float) -> None:
    """Refuse standard deviations below 0.

    Raises
    ------
    ValueError
        Naming the first.
    """
    for name, deviation in deviations.items():
        if deviation < 0.0:
            raise ValueError(f"{name} is a standard deviation, and at least 0, not {deviation:g}")
