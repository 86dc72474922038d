"""Normal draws: the inverse distribution function of the run's uniform draws, one normal for one uniform."""

from __future__ import annotations

from numpy.typing import ArrayLike
from scipy.special import ndtri

from analysis.models.arrays import Array
from netem.core.draws import Purpose, Seed, uniform


def normal(
    seed: Seed, purpose: Purpose, *, tick: ArrayLike = 0, src: ArrayLike = 0, dst: ArrayLike = 0, axes: int
) -> Array:
    """Standard normal draws, shape (..., axes), one row per broadcast (tick, src, dst)."""
    draws: Array = ndtri(uniform(seed, purpose, tick=tick, src=src, dst=dst, lanes=axes))
    return draws
