"""The data of a study as Parquet: a row for each moment of each case, and a row for each run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from affinet.study import Result


QUANTITIES = ("error", "procrustes", "estimation_error", "covariance_trace")


def write(out: Path, results: list[Result]) -> None:
    """`curves.parquet` with mean and standard deviation over the runs, and `runs.parquet` with the mean error of each run."""
    pq.write_table(pa.concat_tables([_curves(one) for one in results]), out / "curves.parquet")
    pq.write_table(pa.concat_tables([_runs(one) for one in results]), out / "runs.parquet")


def _curves(one: Result) -> pa.Table:
    number = len(one.runs.seconds)
    columns = {name: [label] * number for name, label in one.labels.items()} | {"seconds": one.runs.seconds}
    with np.errstate(invalid="ignore", over="ignore"):
        for name in QUANTITIES:
            values = getattr(one.runs, name)
            columns |= {f"mean_{name}": values.mean(axis=0), f"std_{name}": values.std(axis=0)}
    return pa.table(columns)


def _runs(one: Result) -> pa.Table:
    number = len(one.runs.mean_error)
    labels = {name: [label] * number for name, label in one.labels.items()}
    return pa.table(labels | {"run": np.arange(number), "mean_error": one.runs.mean_error})
