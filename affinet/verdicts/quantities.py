"""Quantities: numbers of a run in each of its ticks, which are compared with a level."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from affinet.scenario.words import among
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.metrics import METRICS, of_run
from affinet.verdicts.signals import Signal, Truths
from analysis.models.arrays import Array
from netem.loading.calling import Calling
from netem.loading.returned import WrongReturn, shown
from world.books import realised


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number in each tick of a run, which is compared with a level: the comparison is a signal.

    Parameters
    ----------
    name
        As one writes it.
    unit
        Of its values; "" of a pure number.
    says
        What it is.
    of
        Its values of a run, shape (T,); NaN where there is none.
    """

    name: str
    unit: str
    says: str
    of: Callable[[Evidence], Array]

    def __lt__(self, level: float) -> Signal:
        """Below a level."""
        return self._compared("<", level, np.less)

    def __le__(self, level: float) -> Signal:
        """At most a level."""
        return self._compared("<=", level, np.less_equal)

    def __gt__(self, level: float) -> Signal:
        """Above a level."""
        return self._compared(">", level, np.greater)

    def __ge__(self, level: float) -> Signal:
        """At least a level."""
        return self._compared(">=", level, np.greater_equal)

    def values(self, evidence: Evidence) -> Array:
        """Of a run, shape (T,).

        Raises
        ------
        UserCodeError
            When its function fails, or returns something else.
        """
        with Calling(self.of, self.name):
            values = self.of(evidence)
            if (
                not isinstance(values, np.ndarray)
                or values.dtype.kind not in "fiu"
                or values.shape != (evidence.ticks,)
            ):
                raise WrongReturn(f"a quantity must be numbers (T,) = ({evidence.ticks},), got {shown(values)}")
        return values.astype(np.float64)

    def _compared(self, sign: str, level: float, compare: Any) -> Signal:
        if isinstance(level, bool) or not isinstance(level, int | float) or not np.isfinite(level):
            raise ValueError(f"{self.name} {sign} {level!r}: give a finite number")

        def of(evidence: Evidence) -> Truths:
            values = self.values(evidence)
            known, holds = ~np.isnan(values), compare(values, level)
            return Truths.known(known & holds, known & ~holds)

        def says(evidence: Evidence, tick: int) -> str:
            return f"the {self.name} is {self.values(evidence)[tick]:.4g} {self.unit}".rstrip()

        return Signal(f"({self.name} {sign} {level:g})", of, says)


def quantity(name: str) -> Quantity:
    """One of `QUANTITIES`, by name.

    Raises
    ------
    ValueError
        When there is none.
    """
    if name not in QUANTITIES:
        raise ValueError(f"no quantity {name!r}; {among(name, QUANTITIES)}")
    return QUANTITIES[name]


def _error(evidence: Evidence) -> Array:
    """Where it is no number though it is known where agents are, it is beyond all levels."""
    return np.where(np.isnan(evidence.error) & evidence.located, np.inf, evidence.error)


def _psi(evidence: Evidence) -> Array:
    psi = evidence.arrays["psi"]
    return np.where(np.isnan(psi).all(axis=1), np.nan, np.where(np.isnan(psi), -np.inf, psi).max(axis=1))


def _input(evidence: Evidence) -> Array:
    longest: Array = np.linalg.norm(evidence.arrays["input"], axis=-1).max(axis=1)
    return longest


def _graph(evidence: Evidence) -> realised.Realised:
    plan = evidence.plan
    return realised.realise(
        evidence.arrays["newest"], plan.world.formation, evidence.timeline, plan.world.dt, plan.window
    )


def _least(evidence: Evidence) -> Array:
    least: Array = _graph(evidence).connectivity.min(axis=1)
    return least


def _age(evidence: Evidence) -> Array:
    age = _graph(evidence).age_s
    return np.where(np.isnan(age), evidence.seconds[:, None, None] + evidence.dt, age).max(axis=(1, 2))


def _metric(name: str) -> Quantity:
    metric = METRICS[name]
    return Quantity(name, metric.unit, metric.says, lambda evidence: of_run(evidence, name, range(evidence.ticks)))


QUANTITIES: Mapping[str, Quantity] = {
    one.name: one
    for one in (
        Quantity("error", "m²", "tracking error (15)", _error),
        *map(_metric, METRICS),
        Quantity("psi", "", "largest convergence indicator (16) of an agent", _psi),
        Quantity("input", "m/s", "longest input of an agent; m/s² of bodies that integrate twice", _input),
        Quantity(
            "connectivity", "", "algebraic connectivity of the links that work both ways, on the worst channel", _least
        ),
        Quantity("age", "s", "how old the oldest news of a neighbour is, or for how long there has been none", _age),
    )
}
