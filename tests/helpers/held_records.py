"""What is wrong with the record of a full study, against the study that it is of, and against itself."""

import re

from affinet.studies import judging, record, study
from affinet.studies.quantities import said
from analysis.claims import intervals
from analysis.claims.intervals import Decision, Interval, all_of

NUMBER = r"-?(?:\d[\d.]*(?:e[+-]?\d+)?|inf|nan)"
INTERVAL = rf"({NUMBER}) \(({NUMBER}) to ({NUMBER})\)"
OF_RUNS = re.compile(
    r"(\d+) of (\d+) runs .*?(?:, of (\d+) it cannot be told)?; \d+% to \d+% of all, asked 90% at least"
)
OF_VALUES = re.compile(r"(\d+) of (\d+) are not above(?:, of (\d+) it cannot be told)?; ")
_ROUNDED = 0.006  # figures are given to three digits


def faults(of: study.Study, full: record.StudyRecord):
    """Everything that is wrong, a line each."""
    asked = [(claim.says, record.asked(of, claim)) for claim in judging.all_spelled_out(of)]
    if [(claim.says, claim.asked) for claim in full.claims] != asked:
        yield "its claims are not those of the study, one by one"
    header = (of.title, of.source, False, of.full.runs, intervals.CONFIDENCE)
    if (full.title, full.source, full.quick, full.runs, full.confidence) != header:
        yield "its title, source, runs or confidence are not those of the study"
    if full.flown != record.grid(of, quick=False):
        yield "it is of another grid"
    quantities = dict.fromkeys(
        [of.quantity, *(q for c in of.claims for q in (c.quantity or of.quantity, c.to_quantity) if q)]
    )
    means = [(case.labels, name, said(name)[1]) for case in study.cases(of, quick=False) for name in quantities]
    if [(case.labels, case.quantity, case.unit) for case in full.cases] != means:
        yield "its means are not those of the cases and quantities of the study, one by one"
    for case in full.cases:
        ends = [end for end in (case.low, case.found, case.high) if end is not None]  # of what overflows there are none
        if (case.low is None) != (case.high is None) or (ends and case.found is None) or sorted(ends) != ends:
            yield f"{case.labels} {case.quantity}: {case.found} ({case.low} to {case.high}) is no interval"
    for claim, judged in zip(judging.all_spelled_out(of), full.claims, strict=False):
        yield from (f"{judged.says}: {wrong}" for wrong in _faults_of(of, claim, judged))


def intervals_in(found):
    """What it says of numbers with their intervals."""
    return [Interval(*map(float, ends)) for ends in re.findall(INTERVAL, found)]


def _faults_of(of, claim, judged):
    told = intervals_in(judged.found)
    for one in told:
        if not one.low <= one.found <= one.high and one.found == one.found:
            yield f"{one} is no interval"
    possible = READ[claim.check](claim, judged.found, told)
    if judged.decision not in possible:
        yield f"{judged.decision} does not follow from {judged.found!r}"
    bounds = {"ratio": lambda: claim.between, "value": lambda: sorted(claim.level * f for f in claim.between)}
    if claim.check in bounds:
        least, most = bounds[claim.check]()
        if (
            f"asked {least:.3g} to {most:.3g}" not in judged.found
            and f"asked {least:g} to {most:g}" not in judged.found
        ):
            yield f"asked are {least:g} to {most:g}, and it says {judged.found!r}"
    unit = said(claim.quantity or of.quantity)[1]
    if claim.check in {"lower", "value", "stays_below", "leaves"} and unit and f" {unit}" not in judged.found:
        yield f"it is in {unit}, and says {judged.found!r}"
    if claim.check in {"stays_below", "leaves"} and f" {claim.level:g} {unit}".rstrip() not in judged.found:
        yield f"its level is {claim.level:g} {unit}, and it says {judged.found!r}"
    if claim.check in {"stays_below", "leaves", "exponential"} and f" of {of.full.runs} runs" not in judged.found:
        yield f"it has {of.full.runs} runs, and says {judged.found!r}"


def _either(one: Interval, least: float, most: float):
    """What an interval may decide whose ends were rounded, and those of what is asked."""
    slack = _ROUNDED * max(abs(one.low), abs(one.high), *(abs(end) for end in (least, most) if abs(end) < 1e300))
    wider, narrower = (Interval(one.found, one.low - far, one.high + far) for far in (slack, -slack))
    return {each.decide(least, most) for each in (wider, one, narrower)} | {
        one.decide(least - slack, most + slack),
        one.decide(least + slack, most - slack),
    }


def _all(possible):
    """What may be decided of several, of each of which something may."""
    possible = [*possible]
    worst, best = (
        all_of(pick(each, key=[Decision.DOES_NOT_HOLD, Decision.UNDECIDED, Decision.HOLDS].index) for each in possible)
        for pick in (min, max)
    )
    return {worst, best} | (
        {Decision.UNDECIDED} if {worst, best} == {Decision.DOES_NOT_HOLD, Decision.HOLDS} else set()
    )


def _lower(_claim, found, told):
    sign = -1.0 if found.startswith("higher by") else 1.0
    below = [Interval(sign * one.found, *sorted((sign * one.low, sign * one.high))) for one in told]
    if any(one.low > one.found for one in below) or not found.startswith(("lower by", "higher by")):
        return set()
    return _all(
        _either(one, 0.0, float("inf")) | ({Decision.DOES_NOT_HOLD} if one.high <= 0 else set()) for one in below
    )


def _between(_claim, found, told):
    if not (read := re.search(rf"asked ({NUMBER}) to ({NUMBER})", found)) or len(told) != 1:
        return set()
    return _either(told[0], *map(float, read.groups()))


def _of_most(_claim, found, _told):
    if not (read := OF_RUNS.search(found)):
        return set()
    those, runs, unknown = (int(number or 0) for number in read.groups())
    return {intervals.share(those, unknown, runs).decide(least=0.9)}


def _never_above(_claim, found, _told):
    if not (read := OF_VALUES.search(found)):
        return set()
    those, values, unknown = (int(number or 0) for number in read.groups())
    if those + unknown < values:
        return {Decision.DOES_NOT_HOLD}
    return {Decision.UNDECIDED if unknown or not values else Decision.HOLDS}


def _below_in_mean(_claim, found, _told):
    if found.startswith("above at "):
        return {Decision.DOES_NOT_HOLD}
    read = re.match(r"at (\d+) of (\d+) moments, ", found)
    return {Decision.HOLDS if read[1] == read[2] else Decision.UNDECIDED} if read else set()


def _follows(_claim, found, told):
    read = re.search(rf"asked ({NUMBER})$", found)
    return _either(told[0], float(read[1]), float("inf")) if read and len(told) == 1 else set()


def _flat(_claim, found, told):
    read = re.search(rf"allowed ({NUMBER}):", found)
    return _either(told[0], 0.0, float(read[1])) if read and len(told) == 1 else set()


def _approaches(claim, _found, told):
    """Whether each case is nearer than the next is not told, so that it may hold, or not."""
    *ratios, growth = told
    near = _all([_either(ratios[0], claim.level, float("inf")), _either(growth, 2.0, float("inf"))])
    return near | {Decision.UNDECIDED, Decision.DOES_NOT_HOLD}


READ = {
    "lower": _lower,
    "ratio": _between,
    "value": _between,
    "stays_below": _of_most,
    "leaves": _of_most,
    "exponential": _of_most,
    "slower_with_anchor": _never_above,
    "indicator_below_error": _below_in_mean,
    "indicator_follows_error": _follows,
    "flat": _flat,
    "approaches": _approaches,
}
