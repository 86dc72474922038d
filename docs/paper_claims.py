"""Every numbered claim of the papers, what judges it, and what became of it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from pydantic import Field, model_validator

from affinet.studies import judging, record
from affinet.studies.record import JudgedClaim, Kept
from affinet.studies.study import Claim, Study
from analysis.claims.intervals import Decision, all_of

DOCS = Path(__file__).parent
NOT_ALL_FLOWN, NOT_JUDGED = "not all flown in full yet", "not judged"
OUTCOMES = (*Decision, NOT_ALL_FLOWN, NOT_JUDGED)
PAPERS = {
    "000": "Robust affine formation control of multiagent systems",
    "001": "Distributed Kalman filters for relative formation control",
    "002": "Perception-latency aware distributed target tracking",
    "003": "Distributed relative localization using the multi-dimensional weighted centroid",
    "004": "Edge state Kalman filtering",
}


class PaperClaim(Kept):
    """What a paper says somewhere, and what judges it: claims of a study, tests, or neither, for a reason."""

    paper: str
    where: str
    says: str
    study: str | None = None
    claims: list[str] = Field(default_factory=list)
    tests: list[str] = Field(default_factory=list)
    why: str | None = None

    @model_validator(mode="after")
    def _judged(self) -> PaperClaim:
        if self.paper not in PAPERS:
            raise ValueError(f"{self.where}: no paper {self.paper!r}")
        if bool(self.study) != bool(self.claims):
            raise ValueError(f"{self.where}: a study and the claims of it go together")
        if not (self.claims or self.tests or self.why):
            raise ValueError(f"{self.where}: name the claims of a study, tests, or why it is not judged")
        return self


def paper_claims() -> list[PaperClaim]:
    """All of `claims.toml`."""
    text = (DOCS / "claims.toml").read_text(encoding="utf-8")
    return [PaperClaim.model_validate(one) for one in tomllib.loads(text)["claims"]]


class Found(NamedTuple):
    """What became of a claim of a study in one case: which claim, which case, and what was judged, if it was flown."""

    says: str
    case: str
    judged: JudgedClaim | None


def verdicts(one: PaperClaim, study: Study) -> Iterator[Found]:
    """Every verdict on its claims, for each label.

    Raises
    ------
    KeyError
        When the study makes no such claim.
    """
    full = record.full_study(one.study or "")
    found = {} if full is None else {claim.asked: claim for claim in full.claims}
    for says in one.claims:
        matching = [claim for claim in study.claims if claim.says == says]
        if not matching:
            raise KeyError(f"{one.study} makes no claim {says!r}")
        for spelled in (spelled for claim in matching for spelled in judging.spelled_out(study, claim)):
            labels, _, level = spelled.says.rpartition(says)
            case = f"{labels.removesuffix(': ')}{level}".strip()
            when = ", ".join(filter(None, (case, _window(spelled))))
            yield Found(says, when, found.get(record.asked(study, spelled)))


def _window(claim: Claim) -> str:
    """When it is judged."""
    if claim.until is not None:
        return f"{claim.since:g} to {claim.until:g} s"
    return f"from {claim.since:g} s on" if claim.since else ""


def outcome(one: PaperClaim, study: Study | None) -> str:
    """What became of a claim of a paper in all of its cases, and all that judges it; one of `OUTCOMES`."""
    judged = [] if study is None else [found.judged for found in verdicts(one, study)]
    if not (judged or one.tests):
        return NOT_JUDGED
    decided = all_of(each.decision for each in judged if each is not None) if any(judged) else Decision.HOLDS
    if decided != Decision.DOES_NOT_HOLD and None in judged:
        return NOT_ALL_FLOWN
    return decided
