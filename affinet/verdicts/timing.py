"""How the processes of a run in real time kept their time, in figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Array


class Lateness(NamedTuple):
    """Of a process: how many moments it had to keep, by how much it was late, in milliseconds, and what it missed."""

    moments: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    missed: int


class DelayError(NamedTuple):
    """By how much messages were under way for longer than the network was to delay them, in milliseconds."""

    messages: int
    p50_ms: float
    p99_ms: float
    max_ms: float


class Timing(NamedTuple):
    """Of a run.

    Parameters
    ----------
    lateness
        By process.
    delays
        Of all messages that were delivered; None where there was none.
    """

    lateness: dict[str, Lateness]
    delays: DelayError | None

    @property
    def missed(self) -> int:
        """Deadlines that were missed."""
        return sum(of.missed for of in self.lateness.values())

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        lateness = {name: of._asdict() for name, of in self.lateness.items()}
        return {"missed": self.missed, "lateness": lateness, "delays": self.delays and self.delays._asdict()}


def of_run(out: Path, factor: float) -> Timing | None:
    """That of a run directory, whose run had so many simulated seconds in a second; None where it left none."""
    from netem.core import arrow  # pyarrow takes a while to import
    from netem.medium import deliveries
    from world.books import timing

    try:
        kept, delivered = timing.read(out / timing.FILE), deliveries.read(out / deliveries.FILE)
    except arrow.TableError:
        return None
    names = np.array(kept["process"].to_pylist(), dtype=np.str_)
    late, missed = kept["late_s"].to_numpy(), kept["missed"].to_numpy()
    lateness = {
        str(name): Lateness(int(which.sum()), *_figures(late[which]), int(missed[which].sum()))
        for name in sorted(set(names.tolist()), key=_in_order)
        for which in [names == name]
    }
    longer = (delivered["taken_s"].to_numpy().astype(np.float64) - delivered["asked_s"].to_numpy()) / factor
    return Timing(lateness, DelayError(len(longer), *_figures(longer)) if len(longer) else None)


def _figures(seconds: Array) -> tuple[float, float, float]:
    p50, p99, most = (round(1000.0 * float(value), 4) for value in np.quantile(seconds, [0.5, 0.99, 1.0]))
    return p50, p99, most


def _in_order(name: str) -> tuple[bool, int, str]:
    role, _, number = name.partition(" ")
    return bool(number), int(number or 0), role
