"""What a checker is: a pure function of the evidence, with a verdict and the first tick that offends.

It passes, fails, or is vacuous when the run never put it to the test, and checkers compose: `both & of_these`,
`either | of_these`, `~refuted`. `affinet.verdicts.checkers` has those there are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from affinet.verdicts.evidence import Evidence
from affinet.verdicts.outcome import RunVerdict
from netem.core.plain import shown
from netem.loading.calling import Calling
from netem.loading.returned import WrongReturn, kind


@dataclass(frozen=True)
class CheckResult:
    """What a checker found.

    Parameters
    ----------
    checker
        Its name, with its parameters.
    verdict
        Pass, fail or vacuous.
    tick
        The first tick that offends, when it fails.
    says
        Why, for people.
    """

    checker: str
    verdict: RunVerdict
    tick: int | None
    says: str

    def __str__(self) -> str:
        return f"{self.checker}: {self.verdict}: {self.says}"


@dataclass(frozen=True)
class Checker:
    """What should hold of a run.

    Parameters
    ----------
    name
        With its parameters, as one writes it.
    check
        Finds out.
    """

    name: str
    check: Callable[[Evidence], CheckResult]

    def __call__(self, evidence: Evidence) -> CheckResult:
        """What it finds in a run.

        Raises
        ------
        UserCodeError
            When it fails, or returns no `CheckResult`.
        """
        with np.errstate(over="ignore", invalid="ignore"), Calling(self.check, self.name):  # a run may have diverged
            found = self.check(evidence)
            if not isinstance(found, CheckResult):
                raise WrongReturn(f"must return a CheckResult, got {kind(found)}")
        return found

    def __and__(self, other: Checker) -> Checker:
        """Both hold: the first failure counts, else what is vacuous."""
        return _joined("&", self, other, worst=("fail", "vacuous", "pass"))

    def __or__(self, other: Checker) -> Checker:
        """Either holds."""
        return _joined("|", self, other, worst=("pass", "vacuous", "fail"))

    def __invert__(self) -> Checker:
        """It does not hold."""
        name = f"~{self.name}"

        def check(evidence: Evidence) -> CheckResult:
            found = self(evidence)
            turned: dict[RunVerdict, RunVerdict] = {"pass": "fail", "fail": "pass", "vacuous": "vacuous"}
            verdict = turned[found.verdict]
            return CheckResult(name, verdict, evidence.ticks - 1 if verdict == "fail" else None, found.says)

        return Checker(name, check)


def as_checker(given: Callable[[Evidence], CheckResult]) -> Checker:
    """A checker as it is; a function as the checker of its name.

    Raises
    ------
    TypeError
        When it is neither.
    """
    if isinstance(given, Checker):
        return given
    if not callable(given):
        raise TypeError(f"{shown(given)} is no checker: give checkers, like bounded(5.0), or a Checker of your own")
    return Checker(getattr(given, "__name__", type(given).__name__), given)


def above_zero(checker: str, **numbers: float) -> None:
    """Refuse what is no finite number above 0: a checker would say nothing of any run.

    Raises
    ------
    ValueError
        With the name of the first that is not.
    """
    for name, value in numbers.items():
        if not 0.0 < value < inf:
            raise ValueError(f"{checker}: {name} is {value:g}: give a finite number above 0")


def times(checker: str, **seconds: float | None) -> None:
    """Refuse what is no time of a run, in seconds; None is the end of the run.

    Raises
    ------
    ValueError
        With the name of the first that is not.
    """
    for name, value in seconds.items():
        if value is not None and not 0.0 <= value < inf:
            raise ValueError(f"{checker}: {name} is {value:g}: give finite seconds, at least 0")


def span_of(evidence: Evidence, since: float, until: float | None) -> range:
    """The ticks of a run from `since` to `until`, in seconds, or to its end."""
    stop = evidence.ticks if until is None else min(evidence.ticks, evidence.tick(until) + 1)
    return range(evidence.tick(since), stop)


def moment(evidence: Evidence, tick: int) -> str:
    """A tick, by its time and its number."""
    return f"{tick * evidence.dt:g} s (tick {tick})"


def failed(name: str, evidence: Evidence, tick: int, why: str) -> CheckResult:
    """That something does not hold in a tick, the first in which it does not."""
    return CheckResult(name, "fail", tick, f"at {moment(evidence, tick)} {why}")


def every(name: str, evidence: Evidence, span: range, holds: Any, why: Callable[[int], str]) -> CheckResult:
    """Whether what should hold (T,) does in every tick of a span; `why` says what offends in one."""
    if not len(holds):
        return CheckResult(name, "vacuous", None, "the run ended before")
    if holds.all():
        return CheckResult(name, "pass", None, f"in all of {len(holds)} ticks")
    tick = span.start + int(np.argmin(holds))
    if not evidence.located[tick]:
        return CheckResult(name, "vacuous", None, f"from {tick * evidence.dt:g} s on it is not known where agents are")
    return failed(name, evidence, tick, why(tick))


def _joined(sign: str, one: Checker, other: Checker, worst: tuple[RunVerdict, ...]) -> Checker:
    name = f"({one.name} {sign} {other.name})"

    def check(evidence: Evidence) -> CheckResult:
        found = [one(evidence), other(evidence)]
        chosen = min(found, key=lambda finding: (worst.index(finding.verdict), finding.tick or 0))
        return CheckResult(name, chosen.verdict, chosen.tick, f"{chosen.checker}: {chosen.says}")

    return Checker(name, check)
