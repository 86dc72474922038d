"""A run directory, read again as the evidence it was judged by."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from msgspec import Meta

from affinet.planning import making
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import outcome, timing
from affinet.verdicts.evidence import Evidence
from netem.core.plain import PlainError, from_plain
from netem.faults.timeline import Timeline
from netem.medium.ledger import Accounts
from netem.medium.medium import JOURNAL
from netem.processes.system_errors import said
from world.books import history
from world.books.history import Arrays, Damaged

if TYPE_CHECKING:
    import pyarrow as pa

_Count = Annotated[int, Meta(ge=0)]
_Verdict = Annotated[str, Meta(pattern="^(pass(, transport lost [0-9]+)?|fail|vacuous)$")]
_Seconds = Annotated[float, Meta(ge=0.0, le=1e12)]


@dataclass(frozen=True)
class _Flown:
    """As in `outcome.Outcome`."""

    estimator: str
    law: str
    seed: _Count
    versions: dict[str, str]


@dataclass(frozen=True)
class _Messages:
    ticks: _Count
    offered: _Count
    copies: _Count
    delivered: _Count
    dropped: dict[str, _Count]
    in_flight: _Count
    uninstructed: _Count | None
    transport_lost: _Count


@dataclass(frozen=True)
class _Refused:
    agent: _Count | None
    by: str
    wrong: str
    count: _Count


@dataclass(frozen=True)
class _Process:
    role: str
    id: int | None
    pid: int
    pss_mb: float
    exit: int | None
    machine: str | None = None
    lost: _Count | None = None
    clock_offset_s: float | None = None
    clock_uncertainty_s: float | None = None


@dataclass(frozen=True)
class _Summary:
    """Of `summary.json` what the arrays do not say again."""

    verdict: _Verdict
    reasons: tuple[str, ...]
    user_code: bool
    digest: str | None
    flown: _Flown
    ticks: _Count
    wall_s: _Seconds
    messages: _Messages
    refused: tuple[_Refused, ...]
    processes: tuple[_Process, ...]


def evidence(out: Path) -> Evidence:
    """The run of a directory, with the verdict that it came to.

    Raises
    ------
    ScenarioError
        When it holds no run, or one that has left no summary or no arrays, or its scenario cannot be read any more.
    PlanError, UserCodeError
        When its scenario cannot fly any more.
    Damaged
        When its summary, arrays or journal are not what the run wrote.
    """
    summary = _summary(out)
    file = out / history.ARRAYS
    if not file.is_dir():
        raise ScenarioError(f"{out}: the run left no {history.ARRAYS}: {'; '.join(summary.reasons)}")
    arrays, accounts = history.load(file), _accounts(out)
    plan = making.again(out, (), verdicts=False)
    history.refuse_those_of_another(file, arrays, plan.world, len(plan.channels), plan.reports)
    if summary.ticks != len(arrays["error"]):
        raise Damaged(file, f"it is not that of {outcome.SUMMARY}, which has {summary.ticks} ticks")
    if summary.digest != history.digest(arrays):
        raise Damaged(file, f"it is not that of {outcome.SUMMARY}, which has another digest")
    judged = outcome.judge(
        plan,
        _as_fired(plan.timeline, arrays),
        arrays,
        accounts=accounts,
        uninstructed=summary.messages.uninstructed,
        lost=summary.messages.transport_lost,
        failure=None,
        user_code=summary.user_code,
        wall_s=summary.wall_s,
        refused=[asdict(one) for one in summary.refused],
        processes=[_told(process) for process in summary.processes],
        out=out,
        timing=None if plan.pace is None else timing.of_run(out, plan.pace.factor),
    )
    if summary.verdict != "fail" and judged.messages != asdict(
        summary.messages
    ):  # a failed run may have missed the last
        raise Damaged(out / JOURNAL, f"its accounts are not those of {outcome.SUMMARY}")
    return Evidence(
        plan, arrays, replace(judged, verdict=summary.verdict, reasons=summary.reasons, flown=asdict(summary.flown))
    )


def journal(out: Path) -> pa.Table:
    """The journal of a run directory.

    Raises
    ------
    Damaged
        When there is none, or it is not what a run wrote.
    """
    from netem.medium import journal as journals  # pyarrow takes a while to import

    file = out / JOURNAL
    try:
        return journals.read(file)
    except journals.JournalError as error:
        raise Damaged(file, str(error).removeprefix(f"{file}: ")) from error


def _told(process: _Process) -> dict[str, Any]:
    return {name: value for name, value in asdict(process).items() if value is not None or name in ("id", "exit")}


def _summary(out: Path) -> _Summary:
    file = out / outcome.SUMMARY
    try:
        return from_plain(_Summary, json.loads(file.read_text(encoding="utf-8"), parse_constant=_refuse_constant))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ScenarioError(f"{out}: no run that has ended: it has no {outcome.SUMMARY}") from error
    except PlainError as error:
        raise Damaged(file, str(error).removeprefix(f"{_Summary.__name__}: ")) from error
    except RecursionError as error:
        raise Damaged(file, "it nests too deep") from error
    except OSError as error:
        raise Damaged(file, said(error)) from error
    except ValueError as error:
        raise Damaged(file, str(error)) from error


def _refuse_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number of JSON")


def _accounts(out: Path) -> Accounts | None:
    from netem.medium import journal as journals

    file = out / JOURNAL
    try:
        return journals.told(file).accounts
    except journals.JournalError as error:
        raise Damaged(file, str(error).removeprefix(f"{file}: ")) from error


def _as_fired(timeline: Timeline, arrays: Arrays) -> Timeline:
    """The faults where they came to lie: what waited for a tracking error began in the tick after it."""
    for tick in range(len(arrays["error"])):
        if not timeline.pending:
            break
        if due := timeline.due(arrays["error"][:tick]):
            timeline = timeline.fired(due, tick)
    return timeline
