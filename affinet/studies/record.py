"""What a study leaves of its verdicts, `claims.json`, and those of the full studies that come with affinet."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from affinet.studies import judging
from affinet.studies.quantities import Quantity, over_time, said
from affinet.studies.study import Claim, Labels, Result, Study
from analysis.claims import intervals
from analysis.claims.checks import ClaimVerdict
from analysis.claims.intervals import Decision, Interval
from netem.processes.whole import whole

FILE = "claims.json"
_SEAL = "seal"


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


class JudgedClaim(Kept):
    """What became of a claim; `asked` is a digest of what was asked, and not of how it is said."""

    says: str
    asked: str
    decision: Decision
    found: str


class StudyRecord(Kept):
    """The verdicts of a study, and the means of its cases; `flown` is a digest of what they are of."""

    title: str
    source: str
    flown: str
    quick: bool
    runs: int
    confidence: float
    claims: list[JudgedClaim]
    cases: list[CaseMean]

    def contradicted(self, full: StudyRecord) -> Iterator[JudgedClaim]:
        """The verdicts of a full study on claims that are decided the other way here."""
        others = {claim.asked: claim for claim in full.claims}
        for claim in self.claims:
            other = others.get(claim.asked)
            if other and {claim.decision, other.decision} == {Decision.HOLDS, Decision.DOES_NOT_HOLD}:
                yield other


def grid(study: Study, *, quick: bool) -> str:
    """A digest of what a study flies: its scenario, cases and runs, and not of what it makes of them.

    Raises
    ------
    ScenarioError
        When there is something wrong with its scenario.
    """
    flies = study.model_dump(mode="json", include={"scenario", "set", "axes", "skip"})
    flies |= {
        "size": study.size(quick=quick).model_dump(mode="json"),
        "of": study.loaded(study.set).model_dump(mode="json", exclude_defaults=True),
    }
    return _digest(flies)


def asked(study: Study, claim: Claim) -> str:
    """A digest of what a claim that is spelled out asks of which cases."""
    asks = claim.model_dump(
        mode="json", include={"check", "of", "to", "to_quantity", "level", "between", "since", "until"}
    )
    return _digest(asks | {"quantity": claim.quantity or study.quantity})


def _digest(of: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(of, sort_keys=True).encode()).hexdigest()[:16]


def recorded(
    study: Study, results: Sequence[Result], verdicts: Sequence[ClaimVerdict], *, flown: str, quick: bool
) -> StudyRecord:
    """What is to be kept of a study that was flown and judged; `flown` is its grid from before, whatever its files say now."""
    quantities = dict.fromkeys([study.quantity, *_compared(study)])
    return StudyRecord(
        title=study.title,
        source=study.source,
        flown=flown,
        quick=quick,
        runs=study.size(quick=quick).runs,
        confidence=intervals.CONFIDENCE,
        claims=[
            JudgedClaim(says=verdict.says, asked=asked(study, claim), decision=verdict.decision, found=verdict.found)
            for claim, verdict in zip(judging.all_spelled_out(study), verdicts, strict=True)
        ],
        cases=[mean(one, quantity, study.since) for one in results for quantity in quantities],
    )


def write(out: Path, record: StudyRecord) -> None:
    """Write it into a directory, whole or not at all."""
    kept = record.model_dump(mode="json")
    with whole(out / FILE) as unfinished:
        unfinished.write_text(json.dumps(kept | {_SEAL: _digest(kept)}, indent=1, allow_nan=False) + "\n")


def read(file: Path) -> StudyRecord:
    """What was kept of a study.

    Raises
    ------
    ValueError
        When it is no longer as it was written.
    """
    kept = json.loads(file.read_text())
    if kept.pop(_SEAL, None) != _digest(kept):
        raise ValueError(f"{file} is not as the study left it: fly it again")
    return StudyRecord.model_validate_json(json.dumps(kept))


def full_study(name: str) -> StudyRecord | None:
    """The verdicts of a full study that come with affinet, if they do."""
    file = Path(str(resources.files("affinet.shipped") / "results")) / f"{name}.json"
    return read(file) if file.exists() else None


def _compared(study: Study) -> Iterator[Quantity]:
    for claim in study.claims:
        yield claim.quantity or study.quantity
        if claim.to_quantity:
            yield claim.to_quantity


def mean(one: Result, quantity: Quantity, since: float) -> CaseMean:
    """That of a case over its runs, each from `since` seconds on."""
    found = intervals.mean(over_time(one.runs, quantity, (since, None)))
    return CaseMean(labels=one.labels, quantity=quantity, unit=said(quantity)[1], **_numbers(found))


def _numbers(interval: Interval) -> dict[str, float | None]:
    ends = {"found": interval.found, "low": interval.low, "high": interval.high}
    return {name: end if np.isfinite(end) else None for name, end in ends.items()}
