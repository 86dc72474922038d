"""Checkers: what should hold of a run. How they are made and compose is in `affinet.verdicts.checking`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from affinet.scenario.words import among
from affinet.verdicts.checking import Checker, CheckResult, above_zero, every, failed, moment, span_of, times
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.metrics import METRICS, of_run
from affinet.verdicts.quantities import quantity
from affinet.verdicts.temporal import always
from analysis.metrics import consistency, localization
from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels
from netem.faults.fault import Fault, Verb
from netem.medium.verdict import Verdict
from world.books.localized import FirstMeasurements
from world.physics import sensors

_CORRELATION_TIMES = 40.0  # in a run that says something: four to a batch, as short series find theirs too short
_KEPT_BACK = (Verdict.CUT, Verdict.PARTITION)


def bounded(level: float) -> Checker:
    """The tracking error stays below a level, in square metres.

    Parameters
    ----------
    level
        Of the tracking error, in square metres.
    """
    name = f"bounded({level:g})"
    above_zero(name, level=level)
    return always(quantity("error") < level, name=name)


def converged(level: float, by: float) -> Checker:
    """From a time on, in seconds, the tracking error stays below a level, in square metres.

    Parameters
    ----------
    level
        Of the tracking error, in square metres.
    by
        From when on, in seconds.
    """
    name = f"converged({level:g}, by={by:g})"
    above_zero(name, level=level)
    times(name, by=by)
    return always(quantity("error") < level, since=by, name=name)


def recovers(level: float, within: float) -> Checker:
    """So many seconds after each fault that ends, and until another begins, the tracking error is below a level (m2).

    A fault is looked at where it lifted the error: it rose from below the level to above it since the fault began, or since
    an earlier one did and has been above ever since. Not where another fault still holds at its end, or begins before the
    error has had its time. Vacuous where no fault is left to look at.

    Parameters
    ----------
    level
        Of the tracking error, in square metres.
    within
        How long after the end of a fault, in seconds.
    """
    name = f"recovers({level:g}, within={within:g})"
    above_zero(name, level=level)
    times(name, within=within)

    def check(evidence: Evidence) -> CheckResult:
        faults = [bite.fault for bite in evidence.bites if bite.touched]
        above: Mask = ~(evidence.error < level)
        lifted, why = 0, f"no fault that had its time had lifted the error above {level:g} m²"
        for fault in sorted(faults, key=lambda fault: fault.end or evidence.ticks):
            if fault.end is None or _others_hold(faults, fault, fault.end):
                continue
            deadline = fault.end + evidence.tick(within)
            following = [other.start for other in faults if other is not fault and other.start >= fault.end]
            end = min([evidence.ticks, *following])
            if deadline >= end:
                left = (end - fault.end) * evidence.dt
                had = f"{left:g} s until another began or the run ended"
                why += f"; '{fault.describe()}' had {had}, and needs more than {within:g}"
                continue
            if not _lifted(above[:end], faults, fault):
                if above[fault.start : end].any():
                    why += f": it was above before '{fault.describe()}' began, at {fault.start * evidence.dt:g} s"
                continue
            lifted += 1
            late = above[deadline:end]
            if late.any():
                tick = deadline + int(np.argmax(late))
                after = (tick - fault.end) * evidence.dt
                says = f"it is {evidence.error[tick]:.4g} m², {after:g} s after the end of '{fault.describe()}'"
                return failed(name, evidence, tick, says)
        if not lifted:
            return CheckResult(name, "vacuous", None, why)
        return CheckResult(name, "pass", None, f"after {lifted} faults")

    return Checker(name, check)


def below(metric: str, level: float, *, since: float = 0.0, until: float | None = None) -> Checker:
    """A metric of `METRICS` stays below a level, in its unit, from `since` to `until`, in seconds, wherever there is any.

    Parameters
    ----------
    metric
        One of `METRICS`, by name.
    level
        Of the metric, in its unit.
    since
        From when on, in seconds.
    until
        Up to when, in seconds; None to the end of the run.
    """
    name = f"below({metric!r}, {level:g})"
    if metric not in METRICS:
        raise ValueError(f"{name}: no metric {metric!r}; {among(metric, METRICS)}")
    above_zero(name, level=level)
    times(name, since=since, until=until)

    def check(evidence: Evidence) -> CheckResult:
        span = span_of(evidence, since, until)
        if not span:
            return CheckResult(name, "vacuous", None, "the run ended before")
        values = of_run(evidence, metric, span)
        if np.isnan(values).all():
            return CheckResult(name, "vacuous", None, f"there is no {METRICS[metric].says} in any of its ticks")
        holds: Mask = np.isnan(values) | (values < level)
        unit = METRICS[metric].unit
        return every(name, evidence, span, holds, lambda tick: f"it is {values[tick - span.start]:.4g} {unit}".rstrip())

    return Checker(name, check)


def never_heard_across_a_cut() -> Checker:
    """While a cut or partition holds, nothing that was said under it arrives over its links."""
    name = "never_heard_across_a_cut()"

    def check(evidence: Evidence) -> CheckResult:
        newest, verdicts = evidence.arrays["newest"], evidence.arrays["verdicts"]
        links, kept_back = evidence.plan.world.links, 0
        for number, fault in enumerate(evidence.timeline.faults):
            if fault.verb not in (Verb.CUT, Verb.PARTITION) or fault.trigger is not None:
                continue
            held = evidence.timeline.held(number)
            under = newest[fault.start : fault.end][:, :, held]
            kept_back += int(np.isin(verdicts[fault.start : fault.end][:, :, held], _KEPT_BACK).sum())
            heard = np.argwhere(under >= fault.start)
            if len(heard):
                tick, channel, place = heard[0].tolist()
                row = int(np.flatnonzero(held)[place])
                who = f"{links.dst[row]} heard {links.src[row]} on {evidence.plan.channels[channel]}"
                return failed(name, evidence, fault.start + tick, f"{who} across '{fault.describe()}'")
        if not kept_back:
            return CheckResult(name, "vacuous", None, "nothing was cut")
        return CheckResult(name, "pass", None, f"{kept_back} messages were cut")

    return Checker(name, check)


def consistent(level: float = 0.99, within: float = 0.25, since: float = 0.0) -> Checker:
    """The filters' covariances tell the truth: the mean NEES over edges and ticks is their dimension.

    From `since` on, in seconds. It fails where the confidence interval of that mean, of probability `level`, leaves the
    dimension out; it is vacuous where the interval is wider than a share `within` of it to either side, or where the run is
    shorter than forty times what its ticks are correlated over, which says nothing, unless the mean is out of what a single
    draw can be. The interval is by batch means: edges share their noise, and ticks are correlated.

    Parameters
    ----------
    level
        Confidence of the interval, a probability.
    within
        How wide it may be to either side, as a share of the dimension.
    since
        From when on, in seconds.
    """
    name = f"consistent({level:g}, within={within:g}, since={since:g})"
    if not 0.0 < level < 1.0:
        raise ValueError(f"{name}: level is a probability between 0 and 1")
    above_zero(name, within=within)
    times(name, since=since)

    def check(evidence: Evidence) -> CheckResult:
        span = span_of(evidence, since, None)
        mean, number = _mean_nees(evidence, span)
        ticks = np.flatnonzero(number > 0)
        if len(ticks) < 2 * consistency.BATCHES:
            least = 2 * consistency.BATCHES
            return CheckResult(
                name, "vacuous", None, f"edges were estimated in {len(ticks)} ticks, and {least} are needed"
            )
        if not np.isfinite(mean[ticks]).all():
            tick = span.start + int(ticks[int(np.argmin(np.isfinite(mean[ticks])))])
            if not evidence.located[tick]:
                return CheckResult(
                    name, "vacuous", None, "it is not known where agents are, and so not how far off they are"
                )
            return failed(name, evidence, tick, "the NEES is not a number any more")
        series, dimension = mean[ticks], evidence.plan.world.formation.dimension
        found = consistency.averaged(series, level)
        says = f"mean NEES {found.mean:.3g} +- {found.half:.2g} for {dimension} dimensions"
        off = found.mean - dimension
        wanted = math.ceil(_CORRELATION_TIMES * consistency.correlation_time(series))
        # However correlated they are, their mean spreads no more than a single draw.
        low, high = consistency.band(level, dimension, 1)
        explicable = low <= found.mean <= high
        if len(ticks) < wanted and explicable:
            few = f"in {len(ticks)} ticks, of which {wanted} are needed, as they are correlated"
            return CheckResult(name, "vacuous", None, f"{says} {few}")
        if abs(off) > found.half or not explicable:
            worst = int(np.argmax(np.sign(off) * (found.batches - dimension) >= abs(off)))
            first = span.start + int(ticks[worst * len(ticks) // consistency.BATCHES])
            return CheckResult(name, "fail", first, f"{says}, as far off from {moment(evidence, first)} on")
        if found.half > within * dimension:
            return CheckResult(name, "vacuous", None, f"{says}: too few independent ticks to tell")
        return CheckResult(name, "pass", None, says)

    return Checker(name, check)


def collision_free(distance: float) -> Checker:
    """No two bodies come closer than a distance, in metres; vacuous where there never are two.

    Parameters
    ----------
    distance
        Which two bodies keep at least, in metres.
    """
    name = f"collision_free({distance:g})"
    above_zero(name, distance=distance)

    def check(evidence: Evidence) -> CheckResult:
        position, agents = evidence.position, evidence.plan.world.links.agents
        one, other = np.triu_indices(agents, 1)
        apart = np.linalg.norm(position[:, one] - position[:, other], axis=-1)
        both = evidence.embodied[:, one] & evidence.embodied[:, other]
        if not both.any():
            return CheckResult(name, "vacuous", None, "there were never two bodies")
        apart = np.where(both, apart, np.inf)
        return every(
            name,
            evidence,
            range(evidence.ticks),
            (apart >= distance).all(axis=-1),
            lambda tick: _closest(apart[tick], one, other),
        )

    return Checker(name, check)


def agreement(level: float, by: float = 0.0) -> Checker:
    """From a time on, in seconds, the maps Theta that neighbours perceive differ by an indicator psi (16) below a level.

    Vacuous for estimators that perceive no map.

    Parameters
    ----------
    level
        Of the indicator psi, which has no unit.
    by
        From when on, in seconds.
    """
    name = f"agreement({level:g}, by={by:g})"
    above_zero(name, level=level)
    times(name, by=by)

    def check(evidence: Evidence) -> CheckResult:
        psi, span = evidence.arrays["psi"], span_of(evidence, by, None)
        told = psi[span.start : span.stop]
        if not len(told) or np.isnan(told).all():
            return CheckResult(name, "vacuous", None, "nobody perceived a map and heard another")
        agreed = np.isnan(told) | (told < level)
        return every(
            name,
            evidence,
            span,
            agreed.all(axis=-1),
            lambda tick: f"psi of agent {int(np.argmin(agreed[tick - span.start])) + 1} is {np.nanmax(psi[tick]):.4g}",
        )

    return Checker(name, check)


def energy(level: float) -> Checker:
    """The inputs spend less than a level: the sum of |u|^2 dt over all agents present, in m2/s (m2/s3 of accelerations).

    Parameters
    ----------
    level
        Of what is spent, in metres squared per second.
    """
    name = f"energy({level:g})"
    above_zero(name, level=level)

    def check(evidence: Evidence) -> CheckResult:
        power = np.where(evidence.present[..., None], evidence.arrays["input"] ** 2, 0.0).sum(axis=(1, 2))
        spent = np.cumsum(power) * evidence.dt
        return every(name, evidence, range(evidence.ticks), spent < level, lambda tick: f"{spent[tick]:.4g} are spent")

    return Checker(name, check)


def localized(level: float, by: float = 0.0) -> Checker:
    """From a time on, in seconds, agents are where the best answer to all first measurements puts them, to a level, in metres.

    That is the root of the mean squared distance, both relative to their weighted centroid; vacuous where nobody localizes.

    Parameters
    ----------
    level
        Of how far off they are, in metres.
    by
        From when on, in seconds.
    """
    name = f"localized({level:g}, by={by:g})"
    above_zero(name, level=level)
    times(name, by=by)

    def check(evidence: Evidence) -> CheckResult:
        if channels.PLACE not in evidence.arrays:
            return CheckResult(name, "vacuous", None, "nobody said where it is")
        span = span_of(evidence, by, None)
        known = FirstMeasurements.of(
            evidence.plan.world, evidence.timeline, evidence.arrays["measured"], evidence.arrays["verdicts"][:, 0]
        )
        off = localization.distance(evidence.arrays[channels.PLACE][span.start : span.stop], known.edges())
        if np.isnan(off).all():
            return CheckResult(name, "vacuous", None, "what was measured does not join all agents")
        return every(name, evidence, span, off < level, lambda tick: f"they are {off[tick - span.start]:.4g} m off")

    return Checker(name, check)


def smooth(share: float) -> Checker:
    """Estimated positions do not ring: no more than a share of their steps go back on the step before.

    Parameters
    ----------
    share
        Of the steps that may go back, at least 0 and below 1.
    """
    name = f"smooth({share:g})"
    if not 0.0 <= share < 1.0:
        raise ValueError(f"{name}: share is one of the steps, at least 0 and below 1")

    def check(evidence: Evidence) -> CheckResult:
        if channels.PLACE not in evidence.arrays:
            return CheckResult(name, "vacuous", None, "nobody said where it is")
        place = evidence.arrays[channels.PLACE]
        always = ~np.isnan(place).any(axis=(0, 2))
        if not always.any():
            return CheckResult(name, "vacuous", None, "nobody said all along where it is")
        back = float(localization.ringing(place[:, always]).mean())
        return CheckResult(name, "pass" if back <= share else "fail", None, f"{back:.2%} of the steps go back")

    return Checker(name, check)


def summed_up(evidence: Evidence, findings: Sequence[CheckResult]) -> str:
    """The verdict of a test: a failure outweighs what proved nothing, and that outweighs a pass."""
    verdicts = [evidence.outcome.verdict, *(finding.verdict for finding in findings)]
    return next((verdict for verdict in ("fail", "vacuous") if verdict in verdicts), evidence.outcome.verdict)


def _others_hold(faults: Sequence[Fault], fault: Fault, tick: int) -> bool:
    return any(other is not fault and other.start < tick and other.active(tick) for other in faults)


def _lifted(above: Mask, faults: Sequence[Fault], fault: Fault) -> bool:
    """Whether the error rose since a fault began, or stands where it rose since the first of all did."""
    below = np.flatnonzero(~above[: fault.start])
    last_below = int(below[-1]) if len(below) else -1
    rises = 1 + np.flatnonzero(above[1:] & ~above[:-1])
    return bool((rises > max(last_below, min(other.start for other in faults) - 1)).any())


def _closest(apart: Array, one: Integers, other: Integers) -> str:
    pair = int(np.argmin(apart))
    return f"agents {one[pair] + 1} and {other[pair] + 1} are {apart[pair]:.3g} m apart"


def _mean_nees(evidence: Evidence, span: range) -> consistency.Normalised:
    """Of the edges estimated in each tick."""
    links, arrays = evidence.plan.world.links, evidence.arrays
    part = slice(span.start, span.stop)
    known = arrays["known"][part] & (evidence.awake & evidence.present)[part, :, None]
    true = sensors.relative(evidence.position[part], links)[:, links.slots]
    return consistency.of_errors(arrays["estimate"][part], true, arrays["covariance"][part], known)
