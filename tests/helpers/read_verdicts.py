"""What a verdict says that was found, read back: whether it may be said so, and which decisions follow from it.

Written apart from `analysis.claims.checks`, which says it, so that neither hides a mistake of the other.
"""

import itertools
import math
import re
from dataclasses import dataclass, field

from analysis.claims import intervals
from analysis.claims.intervals import Decision, all_of

NUMBER = r"-?(?:\d[\d.]*(?:e[+-]?\d+)?|inf)|nan"
INTERVAL = rf"(?:{NUMBER}) \((?:{NUMBER}) to (?:{NUMBER})\)"
SEVERAL = rf"{INTERVAL}(?:, {INTERVAL})*"
NOT_PAIRED = " (the runs compared do not meet the same draws)"
NOT_PAIRED_BEFORE = ", of runs with draws of their own"  # in records of before the words changed
_MOST, _DOUBLE, _HIGH = 0.9, 2.0, 0.9


@dataclass(frozen=True)
class Runs:
    """How many runs of how many cases, in which unit, whether paired; the means of them and of others, where known."""

    number: int
    cases: int
    unit: str
    paired: bool
    means: list | None
    others: list | None

    @property
    def after(self):
        """What follows a number."""
        return f" {self.unit}" if self.unit else ""

    @property
    def drawn(self):
        """What follows a comparison."""
        return "" if self.paired else f"(?:{re.escape(NOT_PAIRED)}|{NOT_PAIRED_BEFORE})"

    def known(self):
        """The means, and those of the others, where all of them are numbers."""
        ours, others = ([one.found for one in these or []] for these in (self.means, self.others))
        return (ours, others) if None not in [*ours, *others] else ([], [])


@dataclass(frozen=True)
class Told:
    """Which decisions may follow, and what contradicts itself or the means that are recorded beside it."""

    decisions: set
    wrong: list = field(default_factory=list)


@dataclass(frozen=True)
class Rounded:
    """A number of three digits: the least and the most that is said so."""

    text: str

    @property
    def ends(self):
        value = float(self.text)
        if not value or not math.isfinite(value):
            return value, value
        half = 0.5001 * 10.0 ** (math.floor(math.log10(abs(value))) - 2)
        return value - half, value + half

    def __neg__(self):
        return Rounded(self.text.removeprefix("-") if self.text.startswith("-") else f"-{self.text}")


@dataclass(frozen=True)
class Said:
    """An interval as it is said."""

    found: Rounded
    low: Rounded
    high: Rounded

    def decisions(self, least, most=math.inf):
        """All that its numbers may have decided before they were rounded."""
        (lowest, low), (high, highest) = self.low.ends, self.high.ends
        if low >= least and high <= most:
            yield Decision.HOLDS
        if high < least or low > most:
            yield Decision.DOES_NOT_HOLD
        if (lowest < least or highest > most) and highest >= least and lowest <= most:
            yield Decision.UNDECIDED

    def wrong(self, *, symmetric):
        """Whether it is none; Student's is symmetric, Fieller's is not."""
        low, found, high = self.low.ends, self.found.ends, self.high.ends
        if found[1] < low[0] or found[0] > high[1]:
            yield "what was found is outside of its interval"
        middle = [(one + other) / 2.0 for one, other in zip(low, high, strict=True)]
        if symmetric and (found[1] < middle[0] or found[0] > middle[1]):
            yield "what was found is not in the middle of its interval"

    @property
    def negated(self):
        return Said(-self.found, -self.high, -self.low)


def read(claim, found, runs):
    """What is told of a claim that is spelled out, `Told`, or None where its check never says this of these runs."""
    return READ[claim.check](claim, found, runs)


def _said(text):
    return [Said(*map(Rounded, ends)) for ends in re.findall(rf"({NUMBER}) \(({NUMBER}) to ({NUMBER})\)", text)]


def _differ(said, expected):
    """What a verdict says against the means of all cases, which are recorded beside it."""
    printed = [f"{one:.3g}" for one in expected]
    return [f"the means of the cases say {', '.join(printed)}"] if expected and said != printed else []


def _quotient(one, other):
    return one / other if other else math.nan


def _lower(_claim, found, runs):
    text = re.fullmatch(rf"(lower|higher) by ({SEVERAL}){runs.after}{runs.drawn}", found)
    if not text or len(said := _said(text[2])) != runs.cases:
        return None
    sign = 1.0 if text[1] == "lower" else -1.0
    below = said if text[1] == "lower" else [one.negated for one in said]
    wrong = [each for one in said for each in one.wrong(symmetric=True)]
    not_higher = text[1] == "higher" and any(float(one.found.text) >= 0.0 for one in below)
    wrong += ["it is called higher, and is not"] * not_higher  # lower by less than nothing was said before that word
    means, others = runs.known()
    if means:
        others = others * len(means) if len(others) == 1 else others
        expected = [sign * (other - one) for one, other in zip(means, others, strict=True)]
        wrong += _differ([one.found.text for one in said], expected)
    return Told(_all([{_above_nothing(one)} for one in below]), wrong)


def _above_nothing(one):
    """A number of three digits has the sign of what it was, and is 0 only if that was."""
    low, high = float(one.low.text), float(one.high.text)
    return Decision.HOLDS if low > 0.0 else Decision.DOES_NOT_HOLD if high <= 0.0 else Decision.UNDECIDED


def _ratio(claim, found, runs):
    least, most = claim.between
    text = re.fullmatch(rf"ratio ({INTERVAL}), asked {re.escape(f'{least:g} to {most:g}')}{runs.drawn}", found)
    if not text:
        return None
    (one,) = _said(text[1])
    (mean, other) = runs.known()
    expected = [_quotient(mean[0], other[0])] if mean else []
    wrong = [*one.wrong(symmetric=False), *_differ([one.found.text], expected)]
    return Told({*one.decisions(least, most)}, wrong)


def _value(claim, found, runs):
    least, most = sorted(claim.level * factor for factor in claim.between)
    text = re.fullmatch(rf"({INTERVAL}){runs.after}, asked {re.escape(f'{least:.3g} to {most:.3g}')}", found)
    if not text:
        return None
    (one,) = _said(text[1])
    if runs.known()[0]:
        (mean,) = runs.means
        expected = [end for end in (mean.found, mean.low, mean.high) if end is not None]
        if len(expected) == 3:
            exact = intervals.Interval(*expected)
            return Told({exact.decide(least, most)}, _differ([one.found.text, one.low.text, one.high.text], expected))
    return Told({*one.decisions(least, most)}, [*one.wrong(symmetric=True)])


def _stays_below(claim, found, runs):
    return _of_most(rf"stay below {re.escape(f'{claim.level:g}')}{runs.after}", found, runs)


def _leaves(claim, found, runs):
    return _of_most(rf"come above {re.escape(f'{claim.level:g}')}{runs.after}", found, runs)


def _exponential(_claim, found, runs):
    line = r"fall along a line \(R² at least 0\.99\), to 1/e at least, by no power law below order 10"
    return _of_most(rf"{line}(?:, by (?:{NUMBER}) 1/s)?", found, runs)


def _of_most(do, found, runs):
    untold = r"(?:, of (\d+) it cannot be told)?"
    text = re.fullmatch(rf"(\d+) of (\d+) runs {do}{untold}; (\d+% to \d+%) of all, asked 90% at least", found)
    if not text:
        return None
    those, number, unknown = (int(one or 0) for one in text.groups()[:3])
    if number != runs.number * runs.cases or those + unknown > number:
        return None
    share = intervals.share(those, unknown, number)
    reach = f"{share.low:.0%} to {share.high:.0%}"
    return Told({share.decide(least=_MOST)}, [f"so many runs are {reach} of all"] * (text[4] != reach))


def _never_above(_claim, found, _runs):
    untold = r"(?:, of (\d+) it cannot be told)?"
    text = re.fullmatch(rf"(\d+) of (\d+) are not above{untold}; in the mean ({NUMBER}) against ({NUMBER})", found)
    if not text:
        return None
    those, number, unknown = (int(one or 0) for one in text.groups()[:3])
    if those + unknown < number:
        return Told({Decision.DOES_NOT_HOLD})
    wrong = ["none is above, and their mean is"] * (float(text[4]) > float(text[5]))
    return Told({Decision.UNDECIDED if unknown or not number else Decision.HOLDS}, wrong)


def _below_in_mean(_claim, found, _runs):
    if re.fullmatch(rf"above at [\d.]+% of the moments, first at (?:{NUMBER}) s by (?:\d\S*)", found):
        return Told({Decision.DOES_NOT_HOLD})
    text = re.fullmatch(rf"at (\d+) of (\d+) moments, for all \d+; closest ({NUMBER})", found)
    if not text:
        return None
    below = text[1] == text[2]
    wrong = ["it is below at all moments, and closest above"] * (below and float(text[3]) > 0.0)
    return Told({Decision.HOLDS if below else Decision.UNDECIDED}, wrong)


def _follows(_claim, found, _runs):
    """By the least of all, which decides but where another has a wider interval: no record has such a one."""
    text = re.fullmatch(rf"least rank correlation ({INTERVAL}), asked {_HIGH:g}", found)
    if not text:
        return None
    (one,) = _said(text[1])
    return Told({*one.decisions(_HIGH)}, [*one.wrong(symmetric=True)])


def _flat(claim, found, runs):
    """By the largest of all ratios, which decides but where another has a wider interval: no record has such a one."""
    numbers = rf"((?:{NUMBER})(?:, (?:{NUMBER}))*)"
    text = re.fullmatch(
        rf"largest over smallest ({INTERVAL}), allowed {re.escape(f'{claim.level:g}')}: {numbers}{runs.after}", found
    )
    if not text or len(means := text[2].split(", ")) != runs.cases:
        return None
    (one,) = _said(text[1])
    known, _ = runs.known()
    expected = [max(known) / min(known)] if known and min(known) > 0.0 else []
    wrong = [*one.wrong(symmetric=False), *_differ(means, known), *_differ([one.found.text], expected)]
    return Told({*one.decisions(0.0, claim.level)}, wrong)


def _approaches(claim, found, runs):
    """By the first ratio and the growth; how sure it is that the others are below the first is not told."""
    text = re.fullmatch(
        rf"ratio to the other ({SEVERAL}), from the first case to the last; it grows by ({INTERVAL})", found
    )
    if not text or len(ratios := _said(text[1])) != runs.cases:
        return None
    (growth,) = _said(text[2])
    wrong = [each for one in (*ratios, growth) for each in one.wrong(symmetric=False)]
    means, others = runs.known()
    expected = [*map(_quotient, means, others), *([_quotient(means[0], means[-1])] if means else [])]
    wrong += _differ([one.found.text for one in (*ratios, growth)], expected)
    first, *rest = (float(one.found.text) for one in ratios[:-1])
    nearer = [{Decision.UNDECIDED, Decision.HOLDS if first >= other else Decision.DOES_NOT_HOLD} for other in rest]
    decisions = _all([{*ratios[0].decisions(claim.level)}, {*growth.decisions(_DOUBLE)}, *nearer])
    return Told(decisions, wrong)


def _all(parts):
    """What may be decided of several, of each of which something may."""
    return {all_of(picked) for picked in itertools.product(*parts)}


READ = {
    "lower": _lower,
    "ratio": _ratio,
    "value": _value,
    "stays_below": _stays_below,
    "leaves": _leaves,
    "exponential": _exponential,
    "slower_with_anchor": _never_above,
    "indicator_below_error": _below_in_mean,
    "indicator_follows_error": _follows,
    "flat": _flat,
    "approaches": _approaches,
}
