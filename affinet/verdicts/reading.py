"""A run directory, read again as the evidence it was judged by."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from affinet.planning import making
from affinet.scenario.sections import ScenarioError
from affinet.verdicts import outcome
from affinet.verdicts.evidence import Evidence
from netem.faults.timeline import Timeline
from netem.medium.medium import JOURNAL
from world.books import history
from world.books.history import Arrays

_SUMMED_UP = ("verdict", "reasons", "user_code", "flown", "messages", "wall_s", "processes")


def evidence(out: Path) -> Evidence:
    """The run of a directory, with the verdict that it came to.

    Raises
    ------
    ScenarioError
        When it holds no run, or one that has left no summary or no arrays.
    Damaged
        When its arrays are not what the run wrote.
    """
    from netem.medium import journal  # pyarrow takes a while to import

    summary = _summary(out)
    file = out / history.FILE
    if not file.is_file():
        raise ScenarioError(f"{out}: the run left no {history.FILE}: {'; '.join(summary['reasons'])}")
    plan, arrays = making.again(out, (), verdicts=False), history.load(file)
    timeline = _as_fired(plan.timeline, arrays)
    judged = outcome.judge(
        plan,
        timeline,
        arrays,
        accounts=journal.accounts(journal.read(out / JOURNAL)),
        uninstructed=summary["messages"]["uninstructed"],
        failure=None,
        user_code=summary["user_code"],
        wall_s=summary["wall_s"],
        processes=summary["processes"],
        out=out,
    )
    verdict, reasons = summary["verdict"], tuple(summary["reasons"])
    return Evidence(plan, arrays, replace(judged, verdict=verdict, reasons=reasons, flown=summary["flown"]))


def _summary(out: Path) -> dict[str, Any]:
    file = out / outcome.SUMMARY
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        return {key: said[key] for key in _SUMMED_UP}
    except FileNotFoundError as error:
        raise ScenarioError(f"{out}: no run that has ended: it has no {outcome.SUMMARY}") from error
    except KeyError as error:
        raise ScenarioError(f"{file}: not what a run wrote there: it has no {error}; fly the run again") from error
    except (OSError, ValueError, TypeError) as error:
        raise ScenarioError(f"{file}: not what a run wrote there: {error}; fly the run again") from error


def _as_fired(timeline: Timeline, arrays: Arrays) -> Timeline:
    """The faults where they came to lie: what waited for a tracking error began in the tick after it."""
    for tick in range(len(arrays["error"])):
        if not timeline.pending:
            break
        if due := timeline.due(arrays["error"][:tick]):
            timeline = timeline.fired(due, tick)
    return timeline
