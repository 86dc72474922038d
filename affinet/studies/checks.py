"""What is checked of a study before any of it flies: that its figure can be drawn, and every claim be judged."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from affinet.planning.plan import Plan
from affinet.runtimes.side_by_side import NotABatch, side_by_side
from affinet.scenario.words import among
from affinet.studies.batch import REPORT
from affinet.studies.labelled import is_name, is_number, taken
from analysis.claims.checks import Span
from analysis.models.reports import NIS
from netem.core import channels
from netem.faults import lie

if TYPE_CHECKING:
    from affinet.studies.study import Case, Claim, Study

Wrong = tuple[str, str]  # a key of the study, and what is wrong with it
Planned = tuple["Case", Plan]

# What a study can draw.
FIGURES = {
    "curves": "A quantity over time: panels by two axes, in each a curve for every label of a third, in a band of one "
    "standard deviation over the runs.",
    "map": "The mean of the tracking error as a colour: panels by one axis, rows and columns by two others.",
    "sweep": "The mean of a quantity along an axis of numbers, with its interval of 99 %: panels and curves by two others.",
    "indicator": "The convergence indicators psi beside the tracking error, over time, of one case.",
    "paths": "Where the agents of the first run of each case go, and what one of them flies.",
}
_PANELS = {
    "curves": "one for columns, one for rows, one for the curves",
    "map": "one for panels, one for rows, one for columns",
    "sweep": "one for panels, one for the curves, and the one that it runs along",
}
_INDICATED = {"indicator_below_error", "indicator_follows_error"}
_ONE_CASE = {"ratio", "value", *_INDICATED}  # checks of a single case
_SPREAD = {"lower", "ratio", "value", *_INDICATED}  # checks that need more than one run
_MOST_PATHS = 8  # side by side in a picture
_PLACES = {"localization", "drift", "ringing", "place_error", "place_nees"}
_PURSUED = {"found", "agreed", "ideal", "apart", "disagreed", "behind", "target_nees", "effort"}


def of_file(study: Study) -> Iterator[Wrong]:
    """What is wrong with its axes and labels, as far as the file alone tells."""
    yield from _of_text("title", study.title)
    yield from _of_text("source", study.source)
    wrong = list(_of_axes(study)) or list(_of_labels(study)) or list(_of_figure(study))
    yield from wrong or _of_claims(study)


def of_cases(study: Study, cases: Sequence[Case], runs: int) -> Iterator[Wrong]:
    """What is wrong with the cases that are left, and with how many there are for the figure and for each claim."""
    if not cases:
        yield "skip", "leaves no case to fly"
        return
    if study.figure == "indicator" and len(cases) != 1:
        yield "figure", f"'indicator' is drawn of one case, and there are {len(cases)}: give every axis one label"
    if study.figure == "paths" and len(cases) > _MOST_PATHS:
        yield (
            "figure",
            f"'paths' are drawn of at most {_MOST_PATHS} cases, and there are {len(cases)}: give axes fewer labels",
        )
    for number, claim in enumerate(study.claims, start=1):
        key = f"claims.{number}"
        if runs < 2 and claim.check in _SPREAD:
            yield f"{key}.check", f"{claim.check!r} needs more than one run of each case: raise runs"
        for chosen, compared in _compared(study, claim):
            yield from _of_numbers(key, claim, _those(cases, chosen), chosen, compared, cases)


def of_plans(study: Study, planned: Sequence[Planned], every: Sequence[int]) -> Iterator[Wrong]:
    """What cases would not tell: quantities that nobody in them has, moments that they do not reach.

    Parameters
    ----------
    study, planned
        The study, and its cases with what flies in them.
    every
        Ticks from one moment kept to the next, of each case.
    """
    for case, plan in planned:
        try:
            side_by_side(plan, [0])
        except NotABatch as error:
            yield "scenario", f"case {named(case.labels)}: {error}"
    yield from _seeds(planned)
    moments = {id(plan): range(0, plan.world.ticks, step) for (_, plan), step in zip(planned, every, strict=True)}
    yield from _quantity("quantity", study.quantity, planned)
    for number, quantity in enumerate(study.also, start=1):
        yield from _quantity(f"also.{number}", quantity, planned)
    yield from _span("since", (study.since, None), planned, moments)
    if study.figure == "curves" and len({plan.world.formation.dimension for _, plan in planned}) > 1:
        yield (
            "axes",
            "'curves' are drawn of cases in as many dimensions: fly those of the plane in a study of their own",
        )
    if study.figure == "indicator":
        yield from _maps("figure", planned)
    for number, claim in enumerate(study.claims, start=1):
        key = f"claims.{number}"
        for chosen, compared in _compared(study, claim):
            flown = [one for one in planned if chosen.items() <= one[0].labels.items()]
            others = [one for one in planned if compared is not None and compared.items() <= one[0].labels.items()]
            yield from _quantity(f"{key}.quantity", claim.quantity or study.quantity, flown)
            yield from _quantity(f"{key}.to_quantity", claim.to_quantity or claim.quantity or study.quantity, others)
            yield from _span(f"{key}.since", (claim.since, claim.until), [*flown, *others], moments)
            if claim.check in _INDICATED:
                yield from _maps(f"{key}.check", flown)
            if len({len(moments[id(plan)]) for _, plan in flown}) > 1:
                yield (
                    key,
                    f"its cases {named(chosen)} have ticks of other lengths, or other durations: judge them one by one",
                )


def named(labels: Mapping[str, str]) -> str:
    """Labels as people read them."""
    return ", ".join(f"{axis}={label}" for axis, label in labels.items()) or "all"


def _of_axes(study: Study) -> Iterator[Wrong]:
    names = [axis.name for axis in study.axes]
    for number, axis in enumerate(study.axes, start=1):
        if names.index(axis.name) < number - 1:
            yield f"axes.{number}.name", f"two axes are called {axis.name!r}: call each by a name of its own"
        if axis.name in taken() or REPORT in axis.name:
            yield f"axes.{number}.name", f"{axis.name!r} is a name in the data already: give the axis another"
        if not is_name(axis.name):
            wanted = "a letter, a digit or _ first, no / and no control characters, and no space at the end"
            yield f"axes.{number}.name", f"netCDF has no name {axis.name!r}, in which the data is kept: {wanted}"
        for label in axis.values:
            yield from _of_text(f"axes.{number}.values", label)
        if not axis.values:
            yield f"axes.{number}.values", 'has no label: give at least one, like { "as it is" = [] }'


def _of_text(key: str, text: str) -> Iterator[Wrong]:
    if "\0" in text:
        yield key, f"{text!r} has the character 0, which netCDF cannot keep: leave it out"


def _of_labels(study: Study) -> Iterator[Wrong]:
    known = {axis.name: list(axis.values) for axis in study.axes}
    said = [(f"skip.{number}", labels) for number, labels in enumerate(study.skip, start=1)]
    for number, claim in enumerate(study.claims, start=1):
        key = f"claims.{number}"
        said += [(f"{key}.of", claim.of), (f"{key}.to", claim.to or {})]
        for axis in claim.each:
            if axis not in known:
                yield f"{key}.each", f"no axis is called {axis!r}; {among(axis, known)}"
        if claim.levels is not None and claim.each[0] in known:
            said += [(f"{key}.levels", {claim.each[0]: label}) for label in claim.levels]
    for key, labels in said:
        for axis, label in labels.items():
            if axis not in known:
                yield key, f"no axis {axis!r} has the label {label!r}; no axis is called so: {among(axis, known)}"
            elif label not in known[axis]:
                yield key, f"no axis {axis!r} has the label {label!r}; {among(label, known[axis])}"


def _of_figure(study: Study) -> Iterator[Wrong]:
    names = [axis.name for axis in study.axes]
    if (wanted := _PANELS.get(study.figure)) and len(names) != 3:
        there = f"there are {len(names)}; an axis of one label, like {{ all = [] }}, fills a place"
        yield "axes", f"the figure {study.figure!r} is drawn over three axes, {wanted}; {there}"
    if study.figure != "sweep":
        if study.along is not None:
            yield "along", f"is of a sweep, and the figure is {study.figure!r}: leave it out"
        return
    if study.along is None:
        yield "along", f"is missing: name the axis that the sweep runs along, one of {', '.join(names)}"
    elif study.along not in names:
        yield "along", f"no axis is called {study.along!r}; {among(study.along, names)}"
    else:
        number = names.index(study.along)
        if odd := [label for label in study.axes[number].values if not is_number(label)]:
            yield (
                f"axes.{number + 1}.values",
                f"a sweep runs along numbers, and the label {odd[0]!r} is none: call it 0.5, say",
            )


def _of_claims(study: Study) -> Iterator[Wrong]:
    if study.since < 0.0:
        yield "since", f"should be greater than or equal to 0, got {study.since:g}"
    for number, claim in enumerate(study.claims, start=1):
        if claim.until is not None and claim.until <= claim.since:
            yield f"claims.{number}.until", f"is {claim.until:g} s, and since {claim.since:g} s: until must be later"
        if len(set(claim.each)) < len(claim.each):
            yield f"claims.{number}.each", "names an axis twice"


def _of_numbers(
    key: str,
    claim: Claim,
    flown: Sequence[Case],
    chosen: Mapping[str, str],
    compared: Mapping[str, str] | None,
    cases: Sequence[Case],
) -> Iterator[Wrong]:
    others = None if compared is None else _those(cases, compared)
    for part, found, labels in (("of", flown, chosen), ("to", others, compared)):
        if found is None or labels is None:
            continue
        if not found:
            yield f"{key}.{part}", f"no case has the labels {named(labels)}: all are left out by skip"
        elif claim.check in _ONE_CASE and len(found) != 1:
            free = named(labels)
            yield (
                f"{key}.{part}",
                f"{claim.check!r} is judged of one case, and {len(found)} have the labels {free}: name a label of every axis",
            )
    if flown and others and claim.check not in _ONE_CASE and len(others) not in (1, len(flown)):
        yield f"{key}.to", f"{len(flown)} cases are compared with {len(others)}: as many as them, or one, can be"


def _compared(study: Study, claim: Claim) -> Iterator[tuple[Mapping[str, str], Mapping[str, str] | None]]:
    """The labels of what a claim looks at, and of what it compares that with, for each label of the axes it is for."""
    for where in claim.settings(study.axes):
        yield claim.of | where, None if claim.to is None else claim.to | where


def _those(cases: Sequence[Case], labels: Mapping[str, str]) -> list[Case]:
    return [case for case in cases if labels.items() <= case.labels.items()]


def _seeds(planned: Sequence[Planned]) -> Iterator[Wrong]:
    (first, flown), *others = planned
    for case, plan in others:
        if (seed := plan.scenario.seed) != flown.scenario.seed:
            has = f"{named(first.labels)} has the seed {flown.scenario.seed}, {named(case.labels)} {seed}"
            yield "axes", f"all cases fly with the same seeds, so that they compare; {has}: leave it out of the axes"
            return


def _quantity(key: str, quantity: str, planned: Sequence[Planned]) -> Iterator[Wrong]:
    for case, plan in planned:
        reports = [name for name in plan.reports if name != NIS]  # which is a metric
        if quantity.startswith(REPORT) and (name := quantity.removeprefix(REPORT)) not in reports:
            has = f"has {', '.join(reports)}" if reports else "has none"
            yield key, f"no report is called {name!r}: the estimator of the case {named(case.labels)} {has}"
            return
        if quantity in _PLACES and channels.PLACE not in plan.reports:
            yield (
                key,
                f"{quantity!r} is of agents that find out where they are; nobody does in the case {named(case.labels)}",
            )
            return
        if quantity in _PURSUED and not plan.pursues:
            yield key, f"{quantity!r} is of agents that pursue a target; nobody does in the case {named(case.labels)}"
            return


def _maps(key: str, planned: Sequence[Planned]) -> Iterator[Wrong]:
    for case, plan in planned:
        if lie.CHANNEL not in plan.channels:
            says = f"the indicator is of estimators that tell a map, like conral; case {named(case.labels)} has another"
            yield key, f"{says}: {plan.scenario.agents.estimator!r}"
        elif plan.world.sensor.reads != "coordinates":
            yield key, f"the indicator is bounded for a sensor of coordinates; case {named(case.labels)} has another"


def _span(key: str, span: Span, planned: Sequence[Planned], moments: Mapping[int, range]) -> Iterator[Wrong]:
    since, until = span
    for case, plan in planned:
        seconds = [tick * plan.world.dt for tick in moments[id(plan)]]
        if not any(since <= moment <= (math.inf if until is None else until) for moment in seconds):
            last = f"the last moment of the case {named(case.labels)} is {seconds[-1]:g} s"
            yield (
                key,
                f"no moment lies in the span from {since:g} s {'on' if until is None else f'to {until:g} s'}: {last}",
            )
            return
