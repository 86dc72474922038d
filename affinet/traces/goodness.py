"""Whether a chain could have made a sequence: how long its bursts and gaps are, and how evenly losses spread over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from affinet.traces import runs
from analysis.models.arrays import Array, Mask
from netem.core.draws import uniform
from netem.impairments.chain import Chain, ChainLayer

SIMULATED = 399
LEVEL = 0.01
_AT_ONCE = 19  # sequences that are simulated together
_WINDOWS = 20
_EDGES = np.array([1, 2, 3, 4, 6, 9, 14, 21, 32, 48, 72, 108, 162, 243, 500, 1000, 2000, 5000])
_MOST = 200_000  # messages that are looked at, the first ones


@dataclass(frozen=True)
class Goodness:
    """How probable it is that the chain makes a sequence that is at least as unlike it.

    Parameters
    ----------
    bursts, gaps, spread
        By the lengths of bursts, of what lies between them, and by how losses spread over windows of the sequence.
    p
        Of the three together: three times the least of them, at most 1.
    """

    bursts: float
    gaps: float
    spread: float
    p: float

    @property
    def refused(self) -> bool:
        """Whether the chain cannot have made it."""
        return self.p < LEVEL


def of(chain: Chain, sequences: Sequence[Mask], simulated: int = SIMULATED) -> Goodness:
    """Compare sequences with as many that the chain makes, of the same lengths; the draws are always the same.

    Parameters
    ----------
    chain
        As it was fitted. Nothing is fitted anew to what it makes, so that a chain is refused less often than 1 in 100.
    sequences
        Of messages, lost or not, shape (n,) each; the first 200,000 messages count.
    simulated
        How many times.
    """
    before = np.cumsum([0, *(len(one) for one in sequences)])
    told = [one[: _MOST - begins] for one, begins in zip(sequences, before.tolist(), strict=False) if begins < _MOST]
    seen = _figures([one[None] for one in told])
    made = [
        _figures([_made(chain, len(one), batch, number) for number, one in enumerate(told)])
        for batch in range(-(-simulated // _AT_ONCE))
    ]
    bursts, gaps, spread = (
        _chance(mine[0], np.concatenate([each[which] for each in made])[:simulated]) for which, mine in enumerate(seen)
    )
    return Goodness(bursts, gaps, spread, p=min(1.0, 3.0 * min(bursts, gaps, spread)))


def _made(chain: Chain, length: int, batch: int, number: int) -> Mask:
    """Sequences of a chain, shape (B, n)."""
    layer = ChainLayer.of(0, [chain], np.zeros(1, dtype=bool), sensing=True, comms=True)
    draws = uniform(number, "affinet.traces.goodness", tick=np.arange(length + 1), channel=batch, lanes=2 * _AT_ONCE)
    steps, losses = draws[:, :_AT_ONCE, None], draws[:, _AT_ONCE:, None]
    states, _ = layer.walk(layer.begin(steps[0]), steps[1:])
    return np.asarray(layer.lost(states, losses[1:])[..., 0].T)


def _figures(sequences: Sequence[Mask]) -> tuple[Array, Array, Array]:
    """Of each of B sets of sequences: how many bursts and gaps are how long, shape (B, K), and how losses spread, (B, 1)."""
    bursts = np.sum([_histogram(one) for one in sequences], axis=0)
    gaps = np.sum([_histogram(~one) for one in sequences], axis=0)
    spread = np.mean([_spread(one) for one in sequences], axis=0)
    return bursts, gaps, spread


def _histogram(held: Mask) -> Array:
    length, row = runs.lengths(held)
    cell = row * len(_EDGES) + np.searchsorted(_EDGES, length, side="right") - 1
    return np.bincount(cell, minlength=len(held) * len(_EDGES)).reshape(len(held), -1).astype(np.float64)


def _spread(lost: Mask) -> Array:
    windows = np.array_split(lost, min(_WINDOWS, lost.shape[1]), axis=1)
    shares = np.stack([window.mean(axis=1) for window in windows], axis=1)
    return np.asarray(np.log(shares.var(axis=1, keepdims=True) + 1.0 / lost.shape[1] ** 2), dtype=np.float64)


def _chance(seen: Array, made: Array) -> float:
    """How probable figures (K,) as far from the mean are, by those that were made, shape (B, K)."""
    mean, spread = made.mean(axis=0), made.var(axis=0) + 1e-12
    if (cells := mean >= 0.2).any() and len(mean) > 1:  # what is hardly ever there is one cell

        def pooled(figures: Array) -> Array:
            return np.concatenate([figures[..., cells], figures[..., ~cells].sum(axis=-1, keepdims=True)], axis=-1)

        seen, made = pooled(seen), pooled(made)
        mean, spread = made.mean(axis=0), made.var(axis=0) + 0.1
    far = ((made - mean) ** 2 / spread).sum(axis=-1)
    mine = ((seen - mean) ** 2 / spread).sum()
    return float((1 + (far >= mine).sum()) / (1 + len(made)))
