"""A score as one file that other programs read: every run, every comparison, and the verdict in words."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from affinet.score.card import Scorecard
from affinet.score.judging import CONFIDENCE, MATTERS, Raw, Score
from analysis.claims.intervals import Interval
from netem.processes.system_errors import about
from netem.processes.whole import whole

FILE = "score.json"


def plain(card: Scorecard, raw: Raw, score: Score, flies: dict[str, str], *, quick: bool) -> dict[str, Any]:
    """All of it as plain values: null is no number, "inf" one beyond all."""
    return {
        "title": card.title,
        "scored": raw.scored,
        "against": list(raw.entrants[1:]),
        "size": "quick" if quick else "full",
        "seeds": card.seeds,
        "confidence": CONFIDENCE,
        "matters": MATTERS,
        "flies": flies,
        "verdict": list(score.words),
        "compared": [
            {
                "task": one.task,
                "air": one.air,
                "against": one.rival,
                "factor": _interval(one.factor),
                "decision": one.decision.value,
            }
            for one in score.compared
        ],
        "break_downs": [
            {
                "task": one.task,
                "worsening": one.worsening,
                "entrant": one.entrant,
                "median": _interval(one.median),
                "decision": None if one.decision is None else one.decision.value,
                "runs": _numbers(raw.points[one.task, one.worsening, one.entrant]),
            }
            for one in score.break_downs
        ],
        "cells": [
            {
                "task": task,
                "air": air,
                "entrant": who,
                "unsuited": flown.unsuited,
                "runs": {name: _numbers(values) for name, values in flown.runs.items()},
            }
            for (task, air, who), flown in raw.cells.items()
        ],
        "noisier": [
            {"task": task, "entrant": who, "runs": {name: _numbers(values) for name, values in flown.runs.items()}}
            for (task, who), flown in raw.noisier.items()
        ],
        "times": [{"task": task, "entrant": who, **one._asdict()} for (task, who), one in raw.times.items()],
    }


def write(out: Path, said: dict[str, Any]) -> None:
    """Write it into the directory of the score.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    file = out / FILE
    with about(file), whole(file) as unfinished:
        unfinished.write_text(json.dumps(said, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def of_whom(file: Path) -> tuple[str, str]:
    """Who was scored, and whether in full.

    Raises
    ------
    FileExistsError
        When the file is not of a score.
    """
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        return str(said["scored"]), str(said["size"])
    except (ValueError, TypeError, KeyError, RecursionError):
        raise FileExistsError(f"{file}: not what a score wrote there; remove it, or name another with --out") from None


def _interval(one: Interval) -> dict[str, Any]:
    found, low, high = _numbers([one.found, one.low, one.high])
    return {"found": found, "low": low, "high": high}


def _numbers(values: Iterable[float]) -> list[float | str | None]:
    return [_number(value) for value in values]


def _number(value: float) -> float | str | None:
    if np.isnan(value):
        return None
    return value if np.isfinite(value) else ("inf" if value > 0 else "-inf")
