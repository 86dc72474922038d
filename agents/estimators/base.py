"""What an estimator is.

A frozen dataclass of its parameters, with three pure methods over arrays with any leading axes. What it remembers between
ticks is a state, a NamedTuple of arrays that all begin with those axes. To add one, write a file like `rkf.py`, and name
it in the entry-point group `affinet.estimators` of your own package, or in a scenario as "module:Class".
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeVar

from agents.brief import Brief, Own
from agents.estimate import Estimate
from agents.exchange import Channels, Fields, Heard
from analysis.models.arrays import Array, Mask

State = TypeVar("State")


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
