"""What came of a run: its verdict, its figures, and the files it leaves behind."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from affinet.planning.plan import Plan
from affinet.scenario import inputs, loading
from affinet.verdicts import finite, measures
from affinet.verdicts.bites import Bite, bites
from affinet.verdicts.measures import Figures
from affinet.verdicts.timing import Timing
from affinet.verdicts.zones import Jam, jams
from analysis.models.arrays import Mask
from netem.faults.timeline import Timeline
from netem.medium.ledger import NOTHING, Accounts, Ledger
from netem.medium.medium import JOURNAL
from netem.medium.verdict import Verdict
from netem.processes import system_errors
from netem.processes.whole import whole
from world.books import history
from world.books.history import Arrays, by_span, digest
from world.recording.file import RECORDING

SUMMARY = "summary.json"
_LEFT_BY_A_RUN = (loading.FILE, SUMMARY, history.ARRAYS, JOURNAL, "graph.arrows", "timing.arrows", RECORDING)

RunVerdict = Literal["pass", "fail", "vacuous"]


@dataclass(frozen=True)
class Outcome:
    """The summary of a run; `to_json` is what `--json` prints and `summary.json` holds.

    `verdict` is a `RunVerdict`, or of a run that would pass if the transport between machines had lost nothing, "pass,
    transport lost 3"; `flown` says with what: estimator, law, seed and versions; `errors` has the figures that matter of agents
    that find out where they are, or pursue a target, in metres, which stand in place of the tracking error; `timeline` has the
    faults where they came to lie, `faults` and `zones` what each took hold of; `user_code` says that an estimator or a law is
    why the run ended early; `refused` has the wrong messages of each agent, by whom they were refused, for what, and how many;
    `timing` says how processes kept their time in a run in real time.
    """

    verdict: str
    reasons: tuple[str, ...]
    user_code: bool
    digest: str | None
    flown: dict[str, Any]
    ticks: int
    wall_s: float
    simulated_s: float
    tracking_error: Figures
    errors: dict[str, Figures]
    messages: dict[str, Any]
    faults: tuple[Bite, ...]
    zones: tuple[Jam, ...]
    timeline: Timeline
    refused: tuple[dict[str, Any], ...]
    processes: tuple[dict[str, Any], ...]
    timing: Timing | None
    out: str

    def to_json(self) -> dict[str, Any]:
        """Plain values; a figure that does not exist is null."""
        plain = {name: value for name, value in vars(self).items() if name not in ("simulated_s", "timeline", "timing")}
        if plain.pop("errors"):
            del plain["tracking_error"]
        plain |= self.errors
        plain |= {name: [one.to_json() for one in getattr(self, name)] for name in ("faults", "zones")}
        if self.timing is not None:
            plain["timing"] = self.timing.to_json()
        plain["wall_s"] = round(self.wall_s, 3)
        plain["ticks_per_s"] = round(self.ticks_per_s, 1)
        plain["real_time_factor"] = round(self.real_time_factor, 3)
        return plain

    @property
    def ticks_per_s(self) -> float:
        """Ticks flown per second of wall time."""
        return self.ticks / self.wall_s if self.wall_s > 0 else 0.0

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second of wall time."""
        return self.simulated_s / self.wall_s if self.wall_s > 0 else 0.0

    @property
    def says(self) -> str:
        """The verdict in words; of one that was reached although messages were wrong, how many."""
        refused = sum(one["count"] for one in self.refused)
        return (
            f"{self.verdict}, {refused} wrong messages refused" if refused and self.verdict != "fail" else self.verdict
        )

    def failing(self, reason: str) -> Outcome:
        """The outcome of a run that failed for this reason too."""
        return replace(self, verdict="fail", reasons=(*self.reasons, reason))

    def save(self) -> None:
        """Write `summary.json` into the run directory.

        Raises
        ------
        OSError
            When it cannot be written.
        """
        path = Path(self.out) / SUMMARY
        with system_errors.about(path), whole(path) as unfinished:  # of a full disk no empty one is left
            unfinished.write_text(json.dumps(self.to_json(), indent=2, allow_nan=False) + "\n")


def judge(
    plan: Plan,
    timeline: Timeline,
    arrays: Arrays | None,
    *,
    accounts: Accounts | None,
    uninstructed: int | None,
    failure: str | None,
    user_code: bool,
    wall_s: float,
    processes: list[dict[str, Any]],
    out: Path,
    lost: int = 0,
    timing: Timing | None = None,
    refused: Sequence[dict[str, Any]] = (),
    changed: Mapping[int, int] | None = None,
) -> Outcome:
    """The outcome of a run.

    Parameters
    ----------
    plan
        What was flown.
    timeline
        Its faults, where they came to lie.
    arrays
        What happened; None when the run left no arrays.
    accounts
        What the medium has booked of its messages; None when the run did not get that far. In a run that failed the medium may
        have booked other ticks than the world has flown.
    uninstructed
        Messages lost though nobody ordered it; None when the run did not get to its end.
    failure, user_code
        Why the run ended early, if it did, and whether a user's own code is why.
    wall_s
        From the first tick to the last, in seconds.
    processes, out
        Every process there was, and the run directory.
    lost
        Messages that the transport between machines lost, and that were had again.
    timing
        How they kept their time, in a run in real time.
    refused
        Wrong messages, as in `Outcome`.
    changed
        As of `bites`.
    """
    ticks = len(arrays["error"]) if arrays is not None else accounts.ticks if accounts else 0
    booked = accounts or NOTHING
    faults = [] if arrays is None else bites(plan, timeline, arrays, changed)
    zones = [] if arrays is None else jams(plan, arrays)
    wrong = [failure] if failure else []
    if not failure:
        wrong += _what_is_wrong(plan, arrays, booked, uninstructed)
    idle = [bite for bite in faults if not bite.touched]
    empty = [f"'{bite.fault.describe()}' touched no {bite.what} and proved nothing: {bite.why}" for bite in idle]
    empty += [f"zone {jam.zone} jammed no message and proved nothing: {jam.why}" for jam in zones if not jam.jammed]
    empty += _untracked(plan, arrays)
    verdict: RunVerdict = "fail" if wrong else "vacuous" if empty else "pass"
    said = f"{verdict}, transport lost {lost}" if verdict == "pass" and lost else verdict
    reasons = wrong or empty
    return Outcome(
        verdict=said,
        reasons=tuple(reasons),
        user_code=user_code,
        digest=None if arrays is None else digest(arrays),
        flown=_flown(plan),
        ticks=ticks,
        wall_s=wall_s,
        simulated_s=ticks * plan.world.dt,
        tracking_error=_tracking(arrays),
        errors={} if arrays is None else measures.errors(plan, timeline, arrays),
        messages=_messages(booked, uninstructed, lost),
        faults=tuple(faults),
        zones=tuple(zones),
        timeline=timeline,
        refused=tuple(refused),
        processes=tuple(processes),
        timing=timing,
        out=str(out),
    )


def claim(out: Path) -> None:
    """Make the run directory, before anything is said of a run in it.

    Raises
    ------
    FileExistsError
        When it holds a run already.
    OSError
        When it cannot be made.
    """
    try:
        str(out).encode()
    except UnicodeEncodeError as error:
        raise OSError(
            f"{str(out)!r} is no UTF-8, as what writes recordings wants it; name another directory"
        ) from error
    refuse_taken(out)
    out.mkdir(parents=True, exist_ok=True)


def refuse_taken(out: Path) -> None:
    """Refuse a directory that holds a run already.

    Raises
    ------
    FileExistsError
        When it does.
    """
    there = set(os.listdir(out)) if os.path.isdir(out) else set()  # Path.is_dir raises for a name that is too long
    if taken := [name for name in _LEFT_BY_A_RUN if name in there]:
        raise FileExistsError(f"{str(out)!r} holds a run already: {taken[0]}; name another directory")


def prepare(plan: Plan, out: Path) -> None:
    """Make the run directory, and write down what is about to be flown, with a copy of all it reads.

    Raises
    ------
    FileExistsError
        When it holds a run already.
    OSError
        When it cannot be made, or written to.
    """
    claim(out)
    text = inputs.keep(plan.scenario, plan.journal, out).model_dump_json(indent=2, exclude_none=True) + "\n"
    with system_errors.about(out / loading.FILE):
        try:
            file = (out / loading.FILE).open("x", encoding="utf-8")
        except FileExistsError as error:
            raise FileExistsError(f"{str(out)!r} holds a run already; name another directory") from error
        with file:
            file.write(text)


def _messages(booked: Accounts, uninstructed: int | None, lost: int) -> dict[str, Any]:
    after = {"in_flight": booked.in_flight, "uninstructed": uninstructed, "transport_lost": lost}
    return {"ticks": booked.ticks} | vars(booked.ledger) | after


def _what_is_wrong(plan: Plan, arrays: Arrays | None, booked: Accounts, uninstructed: int | None) -> list[str]:
    wrong = []
    if arrays is None:
        wrong.append("the swarm diverged: a position is not a number any more")
    elif not plan.may_have_gaps and (says := finite.diverged(plan, arrays)):
        wrong.append(says)
    elif np.isinf(arrays["error"]).any():
        wrong.append("the swarm diverged: its tracking error is too large for a number")
    elif says := finite.unknown(plan, arrays):
        wrong.append(says)
    if uninstructed:
        wrong.append(f"{uninstructed} messages were lost that nobody ordered")
    if not booked.close:
        offered = f"{booked.ledger.offered} messages offered and {booked.ledger.copies} doubled"
        wrong.append(f"the accounts do not close: {offered}, {booked.accounted_for} accounted for")
    if arrays is not None and accounts_of(arrays, booked.in_flight) != booked:
        wrong.append("what the medium has booked and what the world was told do not agree")
    return wrong


def accounts_of(arrays: Arrays, in_flight: int) -> Accounts:
    """The accounts of a run that is known by its arrays, after which so many messages are under way."""
    ledger = NOTHING.ledger
    for span in by_span(arrays):
        ledger = ledger.plus(Ledger.of(span["verdicts"], span["copies"], span["late"], span["dropped"]))
    return Accounts(len(arrays["error"]), ledger, in_flight)


def _untracked(plan: Plan, arrays: Arrays | None) -> list[str]:
    if arrays is None or not len(arrays["error"]):
        return ["no tick was flown: it proved nothing"]
    ticks, nobody = len(arrays["error"]), int(np.isnan(arrays["error"]).sum())
    if _all(arrays, lambda span: span["verdicts"][:, 0] == Verdict.SILENT):
        return ["nothing was measured in any tick: it proved nothing"]
    if nobody and not plan.may_have_gaps:
        return [f"nobody took part in {nobody} of {ticks} ticks: there is no tracking error, and it proved nothing"]
    if _all(arrays, lambda span: span["verdicts"][:, 1:] == Verdict.SILENT):
        return ["nobody was awake in any tick: it proved nothing"]
    return []


def _all(arrays: Arrays, holds: Callable[[Arrays], Mask]) -> bool:
    """Whether something holds all the time."""
    return all(bool(holds(span).all()) for span in by_span(arrays))


def _tracking(arrays: Arrays | None) -> Figures:
    return measures.figures(np.empty(0) if arrays is None else arrays["error"])


def _flown(plan: Plan) -> dict[str, Any]:
    agents = plan.scenario.agents
    return {"estimator": agents.estimator, "law": agents.law, "seed": plan.scenario.seed, "versions": dict(_versions())}


@cache
def _versions() -> Mapping[str, str]:
    packages = {"affinet": "affinet", "numpy": "numpy", "zenoh": "eclipse-zenoh"}
    return {name: version(package) for name, package in packages.items()} | {"python": platform.python_version()}
