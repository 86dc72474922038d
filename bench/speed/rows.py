"""Rows of the one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from speed.measured import Measured, of_twice_the_size, over_rounds, ratio


@dataclass(frozen=True)
class Row:
    """A line of the table.

    Parameters
    ----------
    name
        What is held against what.
    ours, theirs
        Costs, as they are read.
    kind, measured
        What came of them: a ratio that should be small, an exponent, or nothing, and then `ours` says why.
    """

    name: str
    ours: str
    theirs: str
    kind: Literal["ratio", "exponent", "nothing"]
    measured: Measured | None

    @property
    def is_steady(self) -> bool:
        """Whether the rounds agree well enough for it to be kept and compared."""
        match self.kind, self.measured:
            case "ratio", Measured() as found:
                return found.is_steady
            case "exponent", Measured() as found:
                return of_twice_the_size(found).is_steady
        return False

    def __str__(self) -> str:
        found = "" if self.measured is None else str(self.measured)
        kind = "exponent " if self.kind == "exponent" else ""
        rounds = "" if self.measured is None else str(self.measured.rounds) + ("" if self.is_steady else ", noisy")
        return f"| {self.name} | {self.ours} | {self.theirs} | {kind}{found} | {rounds} |"


def compared(name: str, ours: Sequence[float], theirs: Sequence[float], unit: Literal["s", "MB"] = "s") -> Row:
    """The ratio of two costs that were measured in the same rounds."""
    show = seconds if unit == "s" else megabytes
    own, other = (show(over_rounds(costs).median) for costs in (ours, theirs))
    return Row(name, own, other, "ratio", ratio(ours, theirs))


def missing(name: str, why: str) -> Row:
    """A peer that is not there."""
    return Row(name, why, "", "nothing", None)


def seconds(cost: float) -> str:
    """In a unit that shows it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if cost >= size:
            return f"{cost / size:.3g} {unit}"
    return f"{cost / 1e-6:.3g} us"


def megabytes(cost: float) -> str:
    """As the processes report it."""
    return f"{cost:.3g} MB"
