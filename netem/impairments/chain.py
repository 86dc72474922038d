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

from analysis.kernels.kernel import Plain, kernel
from analysis.models.algebra import product
from analysis.models.arrays import Array, Integers, Mask

# Probabilities that a user writes add up to 1 within this.
ROUNDING = 1e-9


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

    @cached_property
    def moves(self) -> bool:
        """Whether any link has more than one state."""
        return self.loss.shape[-1] > 1

    @cached_property
    def delays(self) -> bool:
        """Whether a state of any link makes messages late."""
        return bool(self.extra_delay.any())

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
        steps = len(draws)
        walked, after = _walked(draws.reshape(steps, -1), state.reshape(-1), self.cumulative)
        return walked.reshape(steps, *state.shape), after.reshape(state.shape)

    def lost(self, state: Integers, draw: Array) -> Mask:
        """True where a message is lost in these states, for uniform draws (..., L)."""
        decided: Mask = _lost(state, draw, self.loss)
        return decided

    def adds(self, state: Integers) -> Array:
        """Extra delay in these states, in seconds, shape (..., L)."""
        seconds: Array = _of_state(state, self.extra_delay)
        return seconds


def _summed(probabilities: Array) -> Array:
    total: Array = np.cumsum(probabilities, axis=-1)
    total[..., -1] = 1.0  # a draw is below 1: the last state takes what rounding leaves
    return total


def _pick(cumulative: Array, draw: Array) -> Integers:
    chosen: Integers = (draw[..., None] >= cumulative).sum(axis=-1)
    return chosen


@kernel("(t,n),(n),(l,s,s)->(t,n),(n)", "dld->ll")
def _walked() -> Plain:
    def plain(draws: Array, state: Integers, cumulative: Array, states: Integers, after: Integers) -> None:
        links, last = len(cumulative), cumulative.shape[1] - 1  # which is what is left over
        for place in range(len(state)):
            after[place] = state[place]
        for step in range(len(draws)):
            for first in range(0, len(state), links):
                for link in range(links):
                    place = first + link
                    now, following = after[place], 0
                    for chosen in range(last):
                        if draws[step, place] >= cumulative[link, now, chosen]:
                            following += 1
                    states[step, place], after[place] = now, following

    return plain


@kernel("(l),(l),(l,s)->(l)", "ldd->?")
def _lost() -> Plain:
    def plain(state: Integers, draw: Array, loss: Array, lost: Mask) -> None:
        for link in range(len(state)):
            lost[link] = draw[link] < loss[link, state[link]]

    return plain


@kernel("(l),(l,s)->(l)", "ld->d")
def _of_state() -> Plain:
    def plain(state: Integers, values: Array, held: Array) -> None:
        for link in range(len(state)):
            held[link] = values[link, state[link]]

    return plain
