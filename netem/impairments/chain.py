"""Markov chains that lose messages, and what follows from them in closed form.

Every loss that only time decides is a chain: a state per link, a probability of loss in each state, and a step of the state
from one tick (or one message) to the next. Independent loss is a chain of one state. Chains begin in their stationary
distribution, so what is said here of the long run holds from the first tick.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np

from analysis.models.algebra import product
from analysis.models.arrays import Array, Integers, Mask

# Probabilities that a user writes add up to 1 within this.
ROUNDING = 1e-9
# Up to so many, all steps are computed from all states at once; beyond, from the state that is.
_FEW_STATES = 4


@dataclass(frozen=True)
class Chain:
    """A loss process of one link.

    Parameters
    ----------
    transition
        Probability to go from state to state in one step, shape (S, S); rows add up to 1.
    loss
        Probability that a message is lost, by state, shape (S,).
    extra_delay
        What the state adds to a message's delay, in seconds, shape (S,).
    """

    transition: Array
    loss: Array
    extra_delay: Array

    def __post_init__(self) -> None:
        """Refuse what is no chain."""
        rows = self.transition.sum(axis=-1)
        if (self.transition < 0.0).any() or (np.abs(rows - 1.0) > ROUNDING).any():
            raise ValueError(
                f"transition probabilities must not be negative, and add up to 1 from each state, got {self.transition}"
            )
        if ((self.loss < 0.0) | (self.loss > 1.0)).any():
            raise ValueError(f"loss probabilities must lie in [0, 1], got {self.loss}")

    @cached_property
    def stationary(self) -> Array:
        """Share of time in each state, shape (S,); of a chain with several closed classes, the uniform mixture it goes to."""
        states = len(self.loss)
        # Cesaro limit by repeated squaring of the lazy chain, which has the same stationary distributions and no period.
        lazy = (self.transition + np.eye(states)) / 2.0
        for _ in range(60):
            lazy = product(lazy, lazy)
            lazy /= lazy.sum(axis=-1, keepdims=True)
        mixture: Array = lazy.mean(axis=0)
        return mixture

    @property
    def mean_loss(self) -> float:
        """Share of messages lost: sum of pi_s q_s."""
        return float(product(self.stationary, self.loss))

    @property
    def mean_burst(self) -> float:
        """Mean number of messages lost in a row, NaN when none are, infinite when all are."""
        if not self.mean_loss:
            return float("nan")
        begins = float(self._burst_begins.sum())
        return self.mean_loss / begins if begins > 0.0 else float("inf")

    def burst_lengths(self, longest: int) -> Array:
        """Probability that a burst of losses has length 1, 2, ..., `longest`, shape (longest,); NaN where none ever begins."""
        if not self._burst_begins.any():
            return np.full(longest, np.nan)
        going_on = self._burst_begins / self._burst_begins.sum()
        ends = product(self.transition, 1.0 - self.loss)
        lengths = np.empty(longest)
        for n in range(longest):
            lengths[n] = product(going_on, ends)
            going_on = product(going_on, self.transition, self._lost)
        return lengths

    @property
    def mean_age(self) -> float:
        """Mean age of information with one message a step and no delay, in steps: sum over n of P(the last n all lost)."""
        states = len(self.loss)
        try:
            run = np.linalg.solve((np.eye(states) - product(self.transition, self._lost)), np.ones(states))
        except np.linalg.LinAlgError:
            return float("inf")
        age = float(product(self.stationary, self._lost, run))
        return age if 0.0 <= age < 1e12 else float("inf")

    @property
    def mean_extra_delay(self) -> float:
        """Of the messages that pass, in seconds; NaN when none do."""
        passing = self.stationary * (1.0 - self.loss)
        return float(product(passing, self.extra_delay) / passing.sum()) if passing.sum() > 0.0 else float("nan")

    def together(self, other: Chain) -> Chain:
        """Two independent chains on one link: a message passes when both let it, and their delays add."""
        return Chain(
            np.asarray(np.kron(self.transition, other.transition), dtype=np.float64),
            np.asarray(1.0 - np.kron(1.0 - self.loss, 1.0 - other.loss), dtype=np.float64),
            np.add.outer(self.extra_delay, other.extra_delay).ravel(),
        )

    @property
    def _lost(self) -> Array:
        return np.diag(self.loss)

    @property
    def _burst_begins(self) -> Array:
        """Probability that a message passes and the next is lost, by the state of the next, shape (S,)."""
        begins: Array = product(self.stationary * (1.0 - self.loss), self.transition) * self.loss
        return begins


def steady(loss: float = 0.0) -> Chain:
    """The chain of one state."""
    return Chain(np.ones((1, 1)), np.array([loss]), np.zeros(1))


def all_together(chains: Sequence[Chain]) -> Chain:
    """Independent chains on one link as one chain."""
    return reduce(Chain.together, chains, steady())


@dataclass(frozen=True)
class ChainLayer:
    """One chain for every link, of its own parameters; links without one never lose.

    Parameters
    ----------
    lane
        Which of a link's chains it is: draws go by it, so another chain on the link moves no draw of this one.
    cumulative
        Transition probabilities summed along each row, shape (L, S, S); states beyond a link's own are never entered.
    start
        Stationary distribution, summed, shape (L, S).
    loss, extra_delay
        By state, shape (L, S); delays in seconds.
    by_packet
        True where the state steps with every message offered, not with every tick, shape (L,).
    sensing, comms
        The channel classes on which it acts.
    """

    lane: int
    cumulative: Array
    start: Array
    loss: Array
    extra_delay: Array
    by_packet: Mask
    sensing: bool
    comms: bool

    @classmethod
    def of(cls, lane: int, chains: Sequence[Chain], by_packet: Mask, *, sensing: bool, comms: bool) -> ChainLayer:
        """A chain for each link, padded to the largest."""
        states = max(len(chain.loss) for chain in chains)
        links = len(chains)
        cumulative, start = np.ones((links, states, states)), np.ones((links, states))
        loss, extra_delay = np.zeros((links, states)), np.zeros((links, states))
        for row, chain in enumerate(chains):
            own = len(chain.loss)
            cumulative[row, :own, :own] = _summed(chain.transition)
            start[row, :own] = _summed(chain.stationary)
            loss[row, :own], extra_delay[row, :own] = chain.loss, chain.extra_delay
        return cls(lane, cumulative, start, loss, extra_delay, by_packet, sensing, comms)

    def begin(self, draw: Array) -> Integers:
        """States before the first step, for uniform draws (..., L)."""
        return _pick(self.start, draw)

    def walk(self, state: Integers, draws: Array) -> tuple[Integers, Integers]:
        """The states (T, ..., L) of consecutive steps, from `state` (..., L), and the one after them.

        Parameters
        ----------
        state
            In the first step.
        draws
            Uniform, shape (T, ..., L).
        """
        states = np.empty(draws.shape, dtype=np.int64)
        if self.cumulative.shape[-1] == 1:
            states[:] = state
            return states, state
        links = np.arange(state.shape[-1])
        if self.cumulative.shape[-1] > _FEW_STATES:
            for row, draw in enumerate(draws):
                states[row] = state
                state = _pick(self.cumulative[links, state], draw)
            return states, state
        following = _pick(self.cumulative, draws[..., None])  # from whichever state it is in, (T, ..., L, S)
        for row, leads_to in enumerate(following):
            states[row] = state
            state = np.take_along_axis(leads_to, state[..., None], axis=-1)[..., 0]
        return states, state

    def lost(self, state: Integers, draw: Array) -> Mask:
        """True where a message is lost in these states, for uniform draws (..., L)."""
        decided: Mask = draw < self.loss[np.arange(state.shape[-1]), state]
        return decided

    def adds(self, state: Integers) -> Array:
        """Extra delay in these states, in seconds, shape (..., L)."""
        seconds: Array = self.extra_delay[np.arange(state.shape[-1]), state]
        return seconds


def _summed(probabilities: Array) -> Array:
    total: Array = np.cumsum(probabilities, axis=-1)
    total[..., -1] = 1.0  # a draw is below 1: the last state takes what rounding leaves
    return total


def _pick(cumulative: Array, draw: Array) -> Integers:
    chosen: Integers = (draw[..., None] >= cumulative).sum(axis=-1)
    return chosen
