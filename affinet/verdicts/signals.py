"""Signals: what holds of a run in each of its ticks, built of quantities, and of other signals, as in signal temporal logic.

`quantity("error") < 0.3` is one; `a & b`, `a | b`, `~a`, `a.implies(b)`, `a.eventually(within=4)`, `a.always(lasting=1)` and
`a.until(b)` are more of them. In a tick a signal holds, or does not, or it is unknown: of a quantity that is not there, or of a
future that the run has not reached.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from affinet.verdicts.checking import times
from affinet.verdicts.evidence import Evidence
from analysis.models.arrays import Mask
from netem.loading.calling import Calling
from netem.loading.returned import WrongReturn, shown


class Truths(NamedTuple):
    """In which ticks a signal holds, in which it does not, and in which it was put to the test, shape (T,) each."""

    holds: Mask
    fails: Mask
    tested: Mask

    @classmethod
    def known(cls, holds: Mask, fails: Mask) -> Truths:
        """Of what is put to the test wherever it is known."""
        return cls(holds, fails, holds | fails)


@dataclass(frozen=True, eq=False)
class Signal:
    """What holds of a run, tick by tick.

    Parameters
    ----------
    name
        As one writes it.
    of
        In which ticks of a run it does.
    says
        What is the case in a tick, in words: where it does not hold, they are why.
    """

    name: str
    of: Callable[[Evidence], Truths]
    says: Callable[[Evidence, int], str]

    def __bool__(self) -> bool:
        """No signal is true by itself: `and`, `or`, `not` and `1 < q < 4` would keep one half, and drop the other.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError(
            f"{self.name} is no truth value: write & for and, | for or, ~ for not, and (1 < q) & (q < 4) for 1 < q < 4"
        )

    def __and__(self, other: Signal) -> Signal:
        """Both hold."""

        def of(evidence: Evidence) -> Truths:
            one, another = self.of(evidence), other.of(evidence)
            return Truths(one.holds & another.holds, one.fails | another.fails, one.tested | another.tested)

        return self._with("&", other, of)

    def __or__(self, other: Signal) -> Signal:
        """Either holds."""

        def of(evidence: Evidence) -> Truths:
            one, another = self.of(evidence), other.of(evidence)
            return Truths(one.holds | another.holds, one.fails & another.fails, one.tested | another.tested)

        return self._with("|", other, of)

    def __invert__(self) -> Signal:
        """It does not hold."""

        def of(evidence: Evidence) -> Truths:
            holds, fails, tested = self.of(evidence)
            return Truths(fails, holds, tested)

        return Signal(f"~{self.name}", of, self.says)

    def implies(self, other: Signal) -> Signal:
        """Where this holds, so does another; it is put to the test in no tick but those."""

        def of(evidence: Evidence) -> Truths:
            one, another = self.of(evidence), other.of(evidence)
            return Truths(one.fails | another.holds, one.holds & another.fails, one.holds & another.tested)

        return Signal(f"{self.name}.implies({other.name})", of, other.says)

    def eventually(self, within: float) -> Signal:
        """It holds in this tick, or in one of the following ones, `within` so many seconds."""
        times("eventually", within=within)

        def of(evidence: Evidence) -> Truths:
            holds, fails, _ = self.of(evidence)
            ahead = evidence.tick(within)
            return Truths.known(_some(holds, ahead), _all(fails, ahead))

        return Signal(
            f"{self.name}.eventually({within:g})",
            of,
            lambda *_: f"{self.name} holds in no tick of the {within:g} s that follow",
        )

    def always(self, lasting: float) -> Signal:
        """It holds in this tick, and in all that follow, `lasting` so many seconds."""
        times("always", lasting=lasting)

        def of(evidence: Evidence) -> Truths:
            holds, fails, _ = self.of(evidence)
            ahead = evidence.tick(lasting)
            return Truths.known(_all(holds, ahead), _some(fails, ahead))

        return Signal(
            f"{self.name}.always({lasting:g})",
            of,
            lambda *_: f"{self.name} does not hold in all of the {lasting:g} s that follow",
        )

    def until(self, other: Signal) -> Signal:
        """It holds in this tick and in all that follow, up to one in which another does; there has to be one."""

        def of(evidence: Evidence) -> Truths:
            here, there = self.of(evidence), other.of(evidence)
            holds, fails = np.zeros((2, len(here.holds)), dtype=bool)
            later_holds, later_fails = False, False
            for tick in reversed(range(len(holds))):
                holds[tick] = later_holds = bool(there.holds[tick] | (here.holds[tick] & later_holds))
                fails[tick] = later_fails = bool(there.fails[tick] & (here.fails[tick] | later_fails))
            return Truths.known(holds, fails)

        return Signal(f"{self.name}.until({other.name})", of, self.says)

    def _with(self, sign: str, other: Signal, of: Callable[[Evidence], Truths]) -> Signal:
        def says(evidence: Evidence, tick: int) -> str:
            return "; ".join(dict.fromkeys([self.says(evidence, tick), other.says(evidence, tick)]))

        return Signal(f"({self.name} {sign} {other.name})", of, says)


def as_signal(given: Signal | Callable[[Evidence], Mask]) -> Signal:
    """A signal as it is; a function of a run to truths (T,) as the signal of its name.

    Raises
    ------
    TypeError
        When it is neither.
    """
    if isinstance(given, Signal):
        return given
    if not callable(given):
        raise TypeError(f'{given!r} is no signal: give one, like quantity("error") < 0.3, or a function of the run')
    name = getattr(given, "__name__", type(given).__name__)

    def of(evidence: Evidence) -> Truths:
        with Calling(given, name):
            holds = given(evidence)
            if not isinstance(holds, np.ndarray) or holds.dtype != np.bool_ or holds.shape != (evidence.ticks,):
                raise WrongReturn(f"a signal must be bool (T,) = ({evidence.ticks},), got {shown(holds)}")
        return Truths.known(holds, ~holds)

    return Signal(name, of, lambda evidence, tick: f"the error is {evidence.error[tick]:.4g} m²")


def _some(holds: Mask, ahead: int) -> Mask:
    """Whether it holds in some tick from each on, so many ahead, shape (T,), as far as the run goes."""
    so_far = np.concatenate([[0], np.cumsum(holds)])
    ends = np.minimum(np.arange(len(holds)) + ahead + 1, len(holds))
    some: Mask = so_far[ends] > so_far[:-1]
    return some


def _all(holds: Mask, ahead: int) -> Mask:
    """Whether it holds in all of them, which have to lie within the run."""
    within = np.arange(len(holds)) + ahead < len(holds)
    return within & ~_some(~holds, ahead)
