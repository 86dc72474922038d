"""Runs as logs of flights: the rows of a CSV file, as somebody outside would have noted them."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from affinet.planning import making
from affinet.scenario import loading
from world.books import history

Row = dict[str, Any]


def rows_of(out: Path) -> list[Row]:
    """What a run measured, flew and was, row by row."""
    world, arrays = making.make(loading.resolved(out)).world, history.load(out / history.ARRAYS)
    axes, rows = "xyz"[: world.formation.dimension], []
    for tick, place in enumerate(arrays["position"]):
        time = tick * world.dt
        flown = arrays["input"][tick] if tick < world.ticks else np.full_like(place, np.nan)
        for row, (where, velocity) in enumerate(zip(place, flown, strict=True)):
            own = _cells("input", axes, velocity) | _cells("position", axes, where)
            rows.append({"time": time, "agent": row + 1, **own})
        if tick < world.ticks:
            for (src, dst), link in world.links.index.items():
                away = _cells("relative", axes, -arrays["measured"][tick, link])
                rows.append({"time": time, "agent": dst, "neighbour": src, **away})
    return rows


def as_ranges(row: Row) -> Row:
    """The same measurement as a range and a bearing."""
    if "neighbour" not in row:
        return row
    x, y = row["relative_x"], row["relative_y"]
    rest = {name: value for name, value in row.items() if not name.startswith("relative")}
    return rest | {"range": float(np.hypot(x, y)), "bearing": float(np.arctan2(y, x))}


def without(*names: str) -> Callable[[Row], Row]:
    """Rows that do not say this."""
    return lambda row: {name: value for name, value in row.items() if not name.startswith(names)}


def written(path: Path, rows: list[Row]) -> Path:
    """The rows as a file."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)
    return path


def _cells(what: str, axes: str, vector: Any) -> Row:
    return {f"{what}_{axis}": float(value) for axis, value in zip(axes, vector, strict=True) if not np.isnan(value)}
