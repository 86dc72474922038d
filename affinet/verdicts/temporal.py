"""Checkers that follow a signal through a run: it always holds, it does so at some time, or up to something else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from affinet.verdicts.checking import Checker, CheckResult, failed, moment, span_of, times
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.signals import Signal, Truths, as_signal
from analysis.models.arrays import Mask

GivenSignal = Signal | Callable[[Evidence], Mask]


def always(signal: GivenSignal, *, since: float = 0.0, until: float | None = None, name: str | None = None) -> Checker:
    """A signal holds in every tick from `since` to `until`, in seconds; vacuous where no tick puts it to the test.

    Parameters
    ----------
    signal
        What should hold: a `Signal`, or a function of a run to truths of each tick, shape (T,).
    since
        From when on, in seconds.
    until
        Up to when, in seconds; None to the end of the run.
    name
        Under which it is reported; None is that of the signal.
    """
    times("always", since=since, until=until)
    followed = as_signal(signal)
    called = name or f"always({followed.name})"

    def check(evidence: Evidence) -> CheckResult:
        span = span_of(evidence, since, until)
        if not span:
            return CheckResult(called, "vacuous", None, "the run ended before")
        holds, fails, tested = _within(followed, evidence, span)
        if fails.any():
            tick = span.start + int(np.argmax(fails))
            return failed(called, evidence, tick, f"it does not hold; {followed.says(evidence, tick)}")
        if (unknown := ~holds & ~evidence.located[span.start : span.stop]).any():
            since_when = (span.start + int(np.argmax(unknown))) * evidence.dt
            return CheckResult(called, "vacuous", None, f"from {since_when:g} s on it is not known where agents are")
        if not tested.any():
            return CheckResult(called, "vacuous", None, "no tick puts it to the test")
        return CheckResult(called, "pass", None, f"in all of {int(tested.sum())} ticks")

    return Checker(called, check)


def eventually(
    signal: GivenSignal, *, since: float = 0.0, within: float | None = None, name: str | None = None
) -> Checker:
    """A signal holds in some tick from `since` on, `within` so many seconds.

    Parameters
    ----------
    signal
        What should hold: a `Signal`, or a function of a run to truths of each tick, shape (T,).
    since
        From when on, in seconds.
    within
        For how long it is waited for, in seconds; None to the end of the run.
    name
        Under which it is reported; None is that of the signal.
    """
    times("eventually", since=since, within=within)
    followed = as_signal(signal)
    called = name or f"eventually({followed.name})"

    def check(evidence: Evidence) -> CheckResult:
        span = span_of(evidence, since, None if within is None else since + within)
        if not span:
            return CheckResult(called, "vacuous", None, "the run ended before")
        holds, fails, _ = _within(followed, evidence, span)
        if holds.any():
            tick = span.start + int(np.argmax(holds))
            return CheckResult(called, "pass", None, f"from {moment(evidence, tick)} on")
        if not fails.any():
            return CheckResult(called, "vacuous", None, "in no tick is it known whether it does")
        return CheckResult(called, "fail", span.stop - 1, f"never, up to {moment(evidence, span.stop - 1)}")

    return Checker(called, check)


def until(signal: GivenSignal, other: GivenSignal, *, since: float = 0.0, within: float | None = None) -> Checker:
    """A signal holds from `since` on, up to a tick in which another does, which comes `within` so many seconds.

    Parameters
    ----------
    signal
        What should hold until then: a `Signal`, or a function of a run to truths of each tick, shape (T,).
    other
        What it is waited for, likewise.
    since
        From when on, in seconds.
    within
        For how long it is waited for, in seconds; None to the end of the run.
    """
    times("until", since=since, within=within)
    before, then = as_signal(signal), as_signal(other)
    called = f"until({before.name}, {then.name})"

    def check(evidence: Evidence) -> CheckResult:
        span = span_of(evidence, since, None if within is None else since + within)
        if not span:
            return CheckResult(called, "vacuous", None, "the run ended before")
        released = _within(then, evidence, span).holds
        end = int(np.argmax(released)) if released.any() else len(span)
        holds = _within(before, evidence, span).holds[:end]
        if not holds.all():
            tick = span.start + int(np.argmin(holds))
            return failed(called, evidence, tick, f"it does not hold yet; {before.says(evidence, tick)}")
        if not released.any():
            return failed(called, evidence, span.stop - 1, f"{then.name} has never held")
        return CheckResult(called, "pass", None, f"up to {moment(evidence, span.start + end)}")

    return Checker(called, check)


def _within(signal: Signal, evidence: Evidence, span: range) -> Truths:
    return Truths(*(each[span.start : span.stop] for each in signal.of(evidence)))
