"""Loss models, each as a chain with its closed form: what is lost, and in how long bursts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.models.algebra import product
from netem.impairments.chain import ROUNDING, Chain, steady


def bernoulli(p: float) -> Chain:
    """Independent loss (paper 000, section VII-C): mean loss p, mean burst 1 / (1 - p)."""
    return steady(p)


def gilbert_elliott(p: float, r: float, bad: float = 1.0, good: float = 0.0, extra_delay: float = 0.0) -> Chain:
    """Good and bad periods (Gilbert 1960, Elliott 1963).

    Mean loss (p bad + r good) / (p + r); with good = 0 and bad = 1, the mean burst is 1 / r.

    Parameters
    ----------
    p, r
        Probabilities to go from good to bad, and back, in one step.
    bad, good
        Probabilities of loss in the bad and the good state.
    extra_delay
        What the bad state adds to a message's delay, in seconds.

    Raises
    ------
    ValueError
        When the chain would never leave its first state.
    """
    if p == 0.0 and r == 0.0:
        raise ValueError("p and r are both 0: the link would never change")
    return Chain(np.array([[1.0 - p, p], [r, 1.0 - r]]), np.array([good, bad]), np.array([0.0, extra_delay]))


def markov(p13: float, p31: float, p32: float, p23: float, p14: float) -> Chain:
    """The four-state model of netem's `loss state`: 1 good, 2 good within a burst, 3 lost within a burst, 4 lost alone.

    With pi the stationary distribution, mean loss pi_3 + pi_4.

    Parameters
    ----------
    p13, p31, p32, p23, p14
        Transition probabilities; from state 4 the next is always 1.

    Raises
    ------
    ValueError
        When those out of one state add up to more than 1, or the chain cannot move.
    """
    for name, leaving in (("p13 + p14", p13 + p14), ("p31 + p32", p31 + p32)):
        if leaving > 1.0 + ROUNDING:
            raise ValueError(f"{name} is {leaving:g}; the probabilities out of one state add up to at most 1")
    if p13 + p14 == 0.0:
        raise ValueError("p13 and p14 are both 0: no message would ever be lost")
    stays_good, stays_lost = (max(0.0, 1.0 - leaving) for leaving in (p13 + p14, p31 + p32))
    transition = [
        [stays_good, 0.0, p13, p14],
        [0.0, 1.0 - p23, p23, 0.0],
        [p31, p32, stays_lost, 0.0],
        [1.0, 0.0, 0.0, 0.0],
    ]
    return Chain(np.array(transition), np.array([0.0, 0.0, 1.0, 1.0]), np.zeros(4))


def bursts(loss: float, lengths: Sequence[float]) -> Chain:
    """Bursts of given lengths, apart by good runs of geometric length: mean loss `loss`, mean burst sum n lengths[n - 1].

    Parameters
    ----------
    loss
        Mean share of messages lost.
    lengths
        Probability that a burst has length 1, 2, ...; adds up to 1.

    Raises
    ------
    ValueError
        When the lengths are no distribution, or the bursts too short for so much loss (one good step parts two of them).
    """
    chances = np.array(lengths, dtype=np.float64)
    if not len(chances) or (chances < 0.0).any() or abs(chances.sum() - 1.0) > 1e-9:
        raise ValueError(f"lengths must be probabilities that add up to 1, got {list(lengths)}")
    mean = float(product(chances, np.arange(1, len(chances) + 1)))
    most = mean / (mean + 1.0)
    if not 0.0 <= loss <= most + ROUNDING:
        raise ValueError(f"bursts of mean length {mean:g} lose at most {most:.4g} of all messages, not {loss:g}")
    begins = min(1.0, loss / (mean * (1.0 - loss)))
    states = len(chances) + 1
    transition = np.zeros((states, states))
    transition[0] = np.append(1.0 - begins, begins * chances)  # state n > 0: n losses to come
    transition[np.arange(1, states), np.arange(states - 1)] = 1.0
    return Chain(transition, np.append(0.0, np.ones(states - 1)), np.zeros(states))
