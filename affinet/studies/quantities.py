"""What studies draw and judge of their runs, in which unit, and what stands for a run over time."""

from __future__ import annotations

from typing import Literal

import numpy as np

from affinet.studies.batch import Runs
from analysis.claims.checks import Span, within
from analysis.models.arrays import Array

Quantity = Literal[
    "error",
    "procrustes",
    "estimation_error",
    "covariance_trace",
    "nees",
    "nis",
    "localization",
    "drift",
    "ringing",
    "found",
    "agreed",
    "ideal",
    "apart",
    "behind",
    "effort",
    "peak",
]

NAMES: dict[Quantity, tuple[str, str]] = {
    "error": ("tracking error", "m²"),
    "procrustes": ("Procrustes error", "m"),
    "estimation_error": ("estimation error", "m"),
    "covariance_trace": ("trace of the covariances", "m²"),
    "nees": ("normalised estimation error squared", ""),
    "nis": ("normalised innovation squared", ""),
    "localization": ("distance from the optimal places", "m"),
    "drift": ("drift of the weighted centroid", "m"),
    "ringing": ("share of steps that go back", ""),
    "found": ("error of the target by oneself", "m"),
    "agreed": ("error of the target steered for", "m"),
    "ideal": ("error of the target with all that is known", "m"),
    "apart": ("distance of agreement from all that is known", "m"),
    "behind": ("distance from the places steered for", "m"),
    "effort": ("input", "m/s²"),
    "peak": ("longest input", "m/s²"),
}

# Root mean squares over the agents, and so over time as well.
_ROOT_MEAN_SQUARES = frozenset({"found", "agreed", "ideal", "apart", "behind", "effort"})


def over_time(runs: Runs, quantity: Quantity, span: Span) -> Array:
    """What stands for each run over a span of seconds, shape (R,): a mean, a root mean square, or the largest.

    Of the tracking error over all of it, every tick counts.
    """
    if quantity == "error" and span == (0.0, None):
        return runs.mean_error
    values: Array = getattr(runs, quantity)[:, within(runs.seconds, span)]
    if quantity == "peak":
        return np.asarray(values.max(axis=1), dtype=np.float64)
    if quantity in _ROOT_MEAN_SQUARES:
        return np.asarray(np.sqrt((values**2).mean(axis=1)), dtype=np.float64)
    return np.asarray(values.mean(axis=1), dtype=np.float64)
