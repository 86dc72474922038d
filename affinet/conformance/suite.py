"""The suite: all cases, and what each of them shows of an agent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from affinet.conformance.case import Case, NotApplicable
from affinet.conformance.cases import air, answering, forms, garbage, leaving, lives, swarms
from affinet.conformance.flights import PLAIN
from affinet.conformance.flying import Patience, flown
from affinet.conformance.record import Record
from affinet.planning.plan import PlanError
from affinet.scenario.wrong import ScenarioError

Verdict = Literal["pass", "fail", "not applicable", "not reached"]

CASES = tuple(case for matter in (leaving, answering, forms, air, lives, garbage, swarms) for case in matter.CASES)


@dataclass(frozen=True)
class Finding:
    """What a case shows of an agent.

    Parameters
    ----------
    case
        Which.
    verdict
        Whether it does what it has to; `not reached` where its flight ended before that could be seen.
    instead
        What came instead, or why there is no other verdict.
    """

    case: Case
    verdict: Verdict
    instead: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether nothing speaks against the agent."""
        return self.verdict in ("pass", "not applicable")


def findings(
    command: list[str], estimator: str, patience: Patience, cases: Sequence[Case] = CASES
) -> Iterator[Finding]:
    """What the suite finds of the agent that a command line starts, case by case.

    Parameters
    ----------
    command
        What starts it.
    estimator
        Of the scenarios: on which channels it has to broadcast, and what it may report.
    patience
        How long it may do nothing.
    cases
        Which.

    Raises
    ------
    ScenarioError, PlanError
        When there is no such estimator, or it cannot fly the corridor.
    OSError
        When nothing can be started by that command line.
    """
    absent: str | None = None
    first = PLAIN.plan(estimator)
    for flight in dict.fromkeys(case.flight for case in cases):
        of_flight = [case for case in cases if case.flight is flight]
        if absent is not None:
            yield from (Finding(case, "not reached", (absent,)) for case in of_flight)
            continue
        try:
            plan = first if flight is PLAIN else flight.plan(estimator)
        except (PlanError, ScenarioError) as error:
            yield from (Finding(case, "not applicable", (f"{estimator} cannot fly it: {error}",)) for case in of_flight)
            continue
        record = flown(flight, plan, command, patience)
        if flight is PLAIN and not record.asked:
            absent = "it was not ready in the first flight"
        yield from (judged(case, record) for case in of_flight)


def judged(case: Case, record: Record) -> Finding:
    """What a flight shows."""
    try:
        instead = tuple(case.check(record))
    except NotApplicable as why:
        return Finding(case, "not applicable", (str(why),))
    if instead:
        return Finding(case, "fail", instead)
    if record.stopped and not case.shown_early:
        return Finding(case, "not reached", (record.stopped,))
    return Finding(case, "pass")
