"""How many messages came to a verdict, tick by tick."""

from __future__ import annotations

import numpy as np

from analysis.models.arrays import Array
from netem.medium.verdict import Verdict, VerdictCodes


def per_tick(verdicts: VerdictCodes, verdict: Verdict, every: int) -> Array:
    """The mean number in a tick of messages with a verdict, over each stretch of so many ticks.

    Parameters
    ----------
    verdicts
        Of consecutive ticks, shape (T, C, L).
    verdict
        Which.
    every
        Ticks of a stretch; the last may be shorter.

    Returns
    -------
    Array
        Shape (ceil(T / every),).
    """
    starts = np.arange(0, len(verdicts), every)
    lengths = np.diff(np.append(starts, len(verdicts)))
    means: Array = np.add.reduceat((verdicts == verdict).sum(axis=(1, 2)), starts) / lengths
    return means
