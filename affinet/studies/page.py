"""A study as a page of HTML: its verdicts, its figures and the means of its cases."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from html import escape
from pathlib import Path

from affinet.scenario.wrong import ScenarioError
from affinet.studies import record
from affinet.studies.record import CaseMean, JudgedClaim, StudyRecord
from affinet.verdicts.page import html


def is_one(directory: Path) -> bool:
    """Whether a study has left this directory."""
    return (directory / record.FILE).exists()


def page(directory: Path) -> str:
    """The page of a study that has left this directory.

    Raises
    ------
    ScenarioError
        When what it has left is no longer as it was.
    """
    try:
        kept = record.read(directory / record.FILE)
    except ValueError as error:
        raise ScenarioError(str(error)) from error
    form = "a coarse form" if kept.quick else "in full"
    body = [
        f"<h1>{escape(kept.title)}</h1><p>{escape(kept.source)}; {kept.runs} runs of each case, {form}</p>",
        html.section("Claims", _claims(kept)) if kept.claims else "",
        *_figures(directory),
        html.section("Cases", _cases(kept)),
    ]
    return html.document(kept.title, body)


def _claims(kept: StudyRecord) -> str:
    rows = "".join(map(_claim, kept.claims))
    return f'<div class="wide"><table><tr><th>claim</th><th></th><th>found</th></tr>{rows}</table></div>'


def _claim(claim: JudgedClaim) -> str:
    kind = claim.decision.replace(" ", "-")
    decided = f'<td class="verdict {kind}">{escape(claim.decision)}</td>'
    return f"<tr><td>{escape(claim.says)}</td>{decided}<td>{escape(claim.found)}</td></tr>"


def _figures(directory: Path) -> Iterator[str]:
    for picture in sorted(directory.glob("*.png")):
        data = base64.b64encode(picture.read_bytes()).decode()
        yield f'<figure><img alt="{escape(picture.stem)}" src="data:image/png;base64,{data}"></figure>'


def _cases(kept: StudyRecord) -> str:
    labels = list(dict.fromkeys(label for case in kept.cases for label in case.labels))
    rows = [[*(case.labels.get(label, "") for label in labels), *_mean(case)] for case in kept.cases]
    return html.table(rows, head=[*labels, "quantity", "mean", f"{kept.confidence:.0%} interval"])


def _mean(case: CaseMean) -> list[str]:
    ends = [f"{end:.4g}" for end in (case.low, case.high) if end is not None]
    unit = f" ({case.unit})" if case.unit else ""
    return [f"{case.quantity}{unit}", "-" if case.found is None else f"{case.found:.4g}", " to ".join(ends) or "-"]
