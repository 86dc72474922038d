"""What estimators of several kinds report, by the names under which metrics and recordings know it."""

from __future__ import annotations

# How far off the predictions of an agent's edges were: innovations squared, normalised by their covariances, shape (..., n),
# NaN where nothing was measured. Who reports it has the metric of that name.
NIS = "nis"
