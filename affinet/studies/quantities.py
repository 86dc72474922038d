"""What studies draw and judge of their runs, in which unit, and what stands for a run over time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from affinet.scenario.words import hint, shown
from affinet.studies.batch import REPORT, Runs
from affinet.verdicts.metrics import METRICS
from analysis.claims.checks import Span, within
from analysis.models.arrays import Array

NAMES: dict[str, tuple[str, str]] = {
    "error": ("tracking error", "m²"),
    **{name: (metric.says, metric.unit) for name, metric in METRICS.items()},
    "localization": ("distance from the optimal places", "m"),
    "drift": ("drift of the weighted centroid", "m"),
    "ringing": ("share of steps that go back", ""),
    "place_error": ("error of the places", "m"),
    "place_nees": ("NEES of the places", ""),
    "found": ("error of the target by oneself", "m"),
    "agreed": ("error of the target steered for", "m"),
    "ideal": ("error of the target with all that is known", "m"),
    "apart": ("distance of agreement from all that is known", "m"),
    "disagreed": ("disagreement about the target", "m"),
    "behind": ("distance from the places steered for", "m"),
    "target_nees": ("NEES of the target steered for", ""),
    "effort": ("input", "m/s²"),
    "peak": ("longest input", "m/s²"),
    "roughness": ("change of a step from the one before", "m"),
    "fall": ("rate by which the Procrustes error falls", "1/s"),
}

# Root mean squares over the agents, and so over time as well.
_ROOT_MEAN_SQUARES = frozenset(
    {"place_error", "found", "agreed", "ideal", "apart", "disagreed", "behind", "effort", "roughness"}
)

_OVER_TIME: Mapping[str, Callable[[Array], Array]] = {
    "maximum": lambda values: values.max(axis=1),
    "root_mean_square": lambda values: np.sqrt((values**2).mean(axis=1)),
    "mean": lambda values: values.mean(axis=1),
}


def _known(name: str) -> str:
    if name not in NAMES and not (name.startswith(REPORT) and name.removeprefix(REPORT).isidentifier()):
        near = f"; {hint(name, NAMES)}".rstrip("; ")
        names = ", ".join(map(repr, NAMES))
        raise ValueError(f"should be {names}, or '{REPORT}name' of what an estimator reports, got {shown(name)}{near}")
    return name


Quantity = Annotated[str, AfterValidator(_known)]


def said(quantity: str) -> tuple[str, str]:
    """What a quantity is called, and its unit; only who reports one knows that of a report."""
    return NAMES.get(quantity) or (quantity.removeprefix(REPORT).replace("_", " "), "")


def reports(names: Iterable[str]) -> list[str]:
    """Those of these quantities that estimators report."""
    return [name for name in names if name.startswith(REPORT)]


def over_time(runs: Runs, quantity: str, span: Span) -> Array:
    """What stands for each run over a span of seconds, shape (R,): a mean, a root mean square, or the largest.

    Of the tracking error over all of it, every tick counts.
    """
    if quantity == "error" and span == (0.0, None):
        return runs.mean_error
    values: Array = runs.quantities[quantity][:, within(runs.seconds, span)]
    return np.asarray(_OVER_TIME[stands_for(quantity)](values), dtype=np.float64)


def stands_for(quantity: str) -> str:
    """What of it stands for a run over time, as the conventions of netCDF (CF) call it."""
    if quantity == "peak":
        return "maximum"
    return "root_mean_square" if quantity in _ROOT_MEAN_SQUARES else "mean"
