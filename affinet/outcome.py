"""What came of a run: its verdict, its figures, and the files it leaves behind."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from affinet import scenario
from affinet.accounts import Accounts
from affinet.bites import Bite, bites
from affinet.plan import Plan
from netem.fate import Ledger
from netem.timeline import Timeline
from world.history import Arrays, digest

Verdict = Literal["pass", "fail", "vacuous"]


@dataclass(frozen=True)
class Outcome:
    """The summary of a run; `to_json` is what `--json` prints and `summary.json` holds.

    `timeline` has its faults where they came to lie, `faults` what each took hold of.
    """

    verdict: Verdict
    reasons: tuple[str, ...]
    digest: str | None
    ticks: int
    wall_s: float
    simulated_s: float
    tracking_error: dict[str, float | None]
    messages: dict[str, Any]
    faults: tuple[Bite, ...]
    timeline: Timeline
    processes: tuple[dict[str, Any], ...]
    out: str

    def to_json(self) -> dict[str, Any]:
        """Plain values; a figure that does not exist is null."""
        plain = {name: value for name, value in vars(self).items() if name not in ("simulated_s", "timeline")}
        plain["faults"] = [bite.to_json() for bite in self.faults]
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

    def save(self) -> None:
        """Write `summary.json` into the run directory."""
        (Path(self.out) / "summary.json").write_text(json.dumps(self.to_json(), indent=2, allow_nan=False) + "\n")


def judge(
    plan: Plan,
    timeline: Timeline,
    arrays: Arrays | None,
    *,
    in_flight: int | None,
    uninstructed: int | None,
    failure: str | None,
    accounts: Accounts | None = None,
    wall_s: float,
    processes: list[dict[str, Any]],
    out: Path,
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
    in_flight, uninstructed
        Messages under way at the end, and lost though nobody ordered it; None when the run did not get that far.
    failure
        Why the run ended early, if it did.
    accounts
        What the journal says where there are no arrays.
    wall_s
        From the first tick to the last, in seconds.
    processes, out
        Every process there was, and the run directory.
    """
    ticks = len(arrays["error"]) if arrays is not None else accounts.ticks if accounts else 0
    messages = _messages(arrays, accounts, in_flight, uninstructed)
    faults = [] if arrays is None else bites(plan, timeline, arrays)
    wrong = [failure] if failure else []
    if not failure:
        wrong += _what_is_wrong(arrays, messages)
    idle = [bite for bite in faults if not bite.touched]
    verdict: Verdict = "fail" if wrong else "vacuous" if idle else "pass"
    reasons = wrong or [f"'{bite.fault.describe()}' touched no {bite.what}: it proved nothing" for bite in idle]
    return Outcome(
        verdict=verdict,
        reasons=tuple(reasons),
        digest=None if arrays is None else digest(arrays),
        ticks=ticks,
        wall_s=wall_s,
        simulated_s=ticks * plan.world.dt,
        tracking_error=_tracking(arrays),
        messages=messages,
        faults=tuple(faults),
        timeline=timeline,
        processes=tuple(processes),
        out=str(out),
    )


def prepare(plan: Plan, out: Path) -> None:
    """Make the run directory, and write down what is about to be flown.

    Raises
    ------
    FileExistsError
        When it holds a run already.
    """
    if (out / scenario.FILE).exists():
        raise FileExistsError(f"{out} holds a run already; name another directory with --out")
    out.mkdir(parents=True, exist_ok=True)
    (out / scenario.FILE).write_text(plan.scenario.model_dump_json(indent=2, exclude_none=True) + "\n")


def _messages(
    arrays: Arrays | None, accounts: Accounts | None, in_flight: int | None, uninstructed: int | None
) -> dict[str, Any]:
    if arrays is not None:
        ledger = Ledger.of(arrays["fates"], arrays["copies"], arrays["late"], arrays["dropped"])
        in_flight = ledger.outstanding if in_flight is None else in_flight
    elif accounts is not None:
        ledger, in_flight = accounts.ledger, accounts.in_flight
    else:
        ledger = Ledger(offered=0, copies=0, delivered=0, dropped={})
    return {
        "offered": ledger.offered,
        "copies": ledger.copies,
        "delivered": ledger.delivered,
        "dropped": ledger.dropped,
        "in_flight": in_flight,
        "uninstructed": uninstructed,
    }


def _what_is_wrong(arrays: Arrays | None, messages: dict[str, Any]) -> list[str]:
    wrong = []
    if arrays is None or not np.isfinite(arrays["position"]).all():
        wrong.append("the swarm diverged: a position is not a number any more")
    elif not np.isfinite(arrays["estimate"][arrays["known"]]).all():
        wrong.append("an estimate is not a number any more")
    if messages["uninstructed"]:
        wrong.append(f"{messages['uninstructed']} messages were lost that nobody ordered")
    booked = messages["delivered"] + sum(messages["dropped"].values()) + (messages["in_flight"] or 0)
    if messages["offered"] + messages["copies"] != booked:
        offered = f"{messages['offered']} messages offered and {messages['copies']} doubled"
        wrong.append(f"the accounts do not close: {offered}, {booked} accounted for")
    return wrong


def _tracking(arrays: Arrays | None) -> dict[str, float | None]:
    if arrays is None or not len(arrays["error"]):
        return {"mean": None, "final": None, "max": None}
    error = arrays["error"]
    figures = {"mean": error.mean(), "final": error[-1], "max": error.max()}
    return {name: float(value) if np.isfinite(value) else None for name, value in figures.items()}
