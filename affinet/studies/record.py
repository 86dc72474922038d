"""What a study leaves of its verdicts, `claims.json`, and those of the full studies that come with affinet."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from affinet.studies.quantities import Quantity, over_time, said
from affinet.studies.study import Labels, Result, Study
from analysis.claims import intervals
from analysis.claims.checks import ClaimVerdict
from analysis.claims.intervals import Decision, Interval

FILE = "claims.json"


class Kept(BaseModel):
    """What is read from a file that a program wrote."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class CaseMean(Kept):
    """The mean over the runs of a case of what stands for a quantity in each, and its confidence interval; null is none."""

    labels: Labels
    quantity: str
    unit: str
    found: float | None
    low: float | None
    high: float | None


class StudyRecord(Kept):
    """The verdicts of a study, and the means of its cases; `flown` is a digest of the grid that they are of."""

    title: str
    source: str
    flown: str
    quick: bool
    runs: int
    confidence: float
    claims: list[ClaimVerdict]
    cases: list[CaseMean]

    def contradicted(self, full: StudyRecord) -> Iterator[ClaimVerdict]:
        """The verdicts of a full study on claims that are decided the other way here."""
        others = {claim.says: claim for claim in full.claims}
        for claim in self.claims:
            other = others.get(claim.says)
            if other and {claim.decision, other.decision} == {Decision.HOLDS, Decision.DOES_NOT_HOLD}:
                yield other


def grid(study: Study, *, quick: bool) -> str:
    """A digest of what a study flies: its scenario by name, cases and runs, and not of what it makes of them."""
    flies = study.model_dump(mode="json", include={"scenario", "set", "axes", "skip"})
    flies |= {"size": study.size(quick=quick).model_dump(mode="json")}
    return hashlib.sha256(json.dumps(flies, sort_keys=True).encode()).hexdigest()[:16]


def recorded(study: Study, results: Sequence[Result], verdicts: Sequence[ClaimVerdict], *, quick: bool) -> StudyRecord:
    """What is to be kept of a study that was flown and judged."""
    quantities = dict.fromkeys([study.quantity, *_compared(study)])
    return StudyRecord(
        title=study.title,
        source=study.source,
        flown=grid(study, quick=quick),
        quick=quick,
        runs=study.size(quick=quick).runs,
        confidence=intervals.CONFIDENCE,
        claims=list(verdicts),
        cases=[_mean(one, quantity, study.since) for one in results for quantity in quantities],
    )


def write(out: Path, record: StudyRecord) -> None:
    """Write it into a directory."""
    (out / FILE).write_text(json.dumps(record.model_dump(mode="json"), indent=1, allow_nan=False) + "\n")


def read(file: Path) -> StudyRecord:
    """What was kept of a study."""
    return StudyRecord.model_validate_json(file.read_text())


def full_study(name: str) -> StudyRecord | None:
    """The verdicts of a full study that come with affinet, if they do."""
    file = Path(str(resources.files("affinet.shipped") / "results")) / f"{name}.json"
    return read(file) if file.exists() else None


def _compared(study: Study) -> Iterator[Quantity]:
    for claim in study.claims:
        yield claim.quantity or study.quantity
        if claim.to_quantity:
            yield claim.to_quantity


def _mean(one: Result, quantity: Quantity, since: float) -> CaseMean:
    found = intervals.mean(over_time(one.runs, quantity, (since, None)))
    return CaseMean(labels=one.labels, quantity=quantity, unit=said(quantity)[1], **_numbers(found))


def _numbers(interval: Interval) -> dict[str, float | None]:
    ends = {"found": interval.found, "low": interval.low, "high": interval.high}
    return {name: end if np.isfinite(end) else None for name, end in ends.items()}
