"""What an estimator is.

A frozen dataclass of its parameters, with three pure methods over arrays with any leading axes. What it remembers between
ticks is a state, a NamedTuple of arrays that all begin with those axes. What else it may say has defaults, which hold for
estimators that are no subclass too. To add one, write a file like `rkf.py`, and name it in the entry-point group
`affinet.estimators` of your own package, or in a scenario as "module:Class".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from agents.wants import Wants
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding

State = TypeVar("State")


class CentreEstimate(NamedTuple):
    """What a centre tells all agents of their edges: relative positions (..., N, n, D), and covariances (..., N, n, D, D).

    And, if it has them, its innovations as in `analysis.models.reports.NIS`, shape (..., N, n).
    """

    relative: Array
    covariance: Array
    nis: Array | None = None


class Centre(Protocol[State]):
    """A filter that hears everybody, past the medium, and tells each agent its edges."""

    def begin(self, batch: tuple[int, ...]) -> State:
        """The state before the first tick, with `batch` as its leading axes."""

    def step(self, state: State, measured: Array, seen: Mask, inputs: Array) -> tuple[State, CentreEstimate]:
        """Take in what all agents measured and flew, and estimate.

        Parameters
        ----------
        state
            What it remembers.
        measured, seen
            Relative positions, shape (..., N, n, D), in metres, and which were made, shape (..., N, n).
        inputs
            What the agents flew from the tick before, shape (..., N, D), in metres per second, or per second squared.
        """


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

    def missed(self, brief: Brief, state: State, gap: Gap) -> State:  # noqa: ARG002
        """The state after ticks in which the agent neither measured nor heard, before `sense`; unchanged by default.

        It is called when an agent goes on that was paused, or killed and restarted with its state.
        """
        return state

    @property
    def wants(self) -> Wants:
        """What it wants beyond what every agent gets; nothing by default."""
        return Wants()

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:  # noqa: ARG002
        """What it finds of a swarm that is to fly it; an error refuses the scenario. Nothing by default."""
        return []

    def centre(self, swarm: SwarmBrief) -> Centre[Any] | None:  # noqa: ARG002
        """The filter that hears everybody, and tells on `heard["centre"]`; None, the default, where it wants none.

        It waits for every agent in every tick, so that nobody can be killed or paused.
        """
        return None


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
