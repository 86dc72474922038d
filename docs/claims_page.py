"""docs/claims.md and docs/claims/: what becomes of every numbered claim of the five papers, from `claims.toml` and studies.

python docs/claims_page.py                      write the pages
python docs/claims_page.py NAME=DIRECTORY ...   take in full studies first, their verdicts and figures
python docs/claims_page.py --sweeps             draw the figures of sweeps first, from the means that were kept
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from textwrap import fill

from paper_claims import DOCS, OUTCOMES, PAPERS, Found, PaperClaim, outcome, paper_claims, verdicts

from affinet.studies import record, report
from affinet.studies import study as studies
from affinet.studies.batch import REPORT
from affinet.studies.record import CaseMean, JudgedClaim, StudyRecord
from affinet.studies.study import Study
from analysis.claims.intervals import Decision

PICTURES = DOCS / "pictures"
_SIGNED = {"fall"}  # quantities that may be negative
_MANY = 4  # cases that come out alike are counted
_NOT_FLOWN = "not flown in full yet"
OWN = "own"  # of the page of studies that are no paper's
RESULTS = DOCS.parent / "affinet" / "shipped" / "results"


def pages() -> dict[str, str]:
    """Every page by its file in docs/, from what is there."""
    rows = paper_claims()
    named = {name: studies.load(name) for name in studies.shipped()}
    made = {
        "claims.md": _overview(rows, named),
        **{f"claims/{paper}.md": _of_paper(paper, rows, named) for paper in PAPERS},
        f"claims/{OWN}.md": ["# Studies of our own", *_means(OWN, rows, named)],
    }
    return {file: "\n".join(lines) + "\n" for file, lines in made.items()}


def _overview(rows: Sequence[PaperClaim], named: dict[str, Study]) -> Sequence[str]:
    """What is judged and how, and how much came out."""
    return [
        "# What becomes of the papers' claims",
        "",
        f"The [five papers](papers/index.md) whose algorithms affinet has make {len(rows)} claims: which estimator errs less,",
        "by how much, under which losses. They were flown again, or computed; each holds, does not hold, or is undecided,",
        "and a few are not judged, with the reason beside them:",
        "",
        *(f"- [Paper {paper}](claims/{paper}.md): {title}" for paper, title in PAPERS.items()),
        f"- [Studies of our own](claims/{OWN}.md)",
        "",
        *_tally(rows, named),
        "",
        "## How they are judged",
        "",
        "By many runs with seeds of their own, and intervals of 99 % confidence: a claim holds where all of its interval is",
        "inside what is asked, and is undecided where only a part is",
        "([decision 22](decisions/0022-claims-hold-fail-or-are-undecided.md)). What is proved in a paper and computed",
        "exactly is judged by tests, against the formulas, other implementations, or the definition. Whoever wants a verdict",
        "again flies the study that is beside it: as many runs of the same draws, and the same bits.",
        "",
        "`python docs/claims_page.py` writes this page, and one for each paper, from `docs/claims.toml` and from the",
        "`claims.json` of full studies, which are in `affinet/shipped/results/`.",
    ]


def _of_paper(paper: str, rows: Sequence[PaperClaim], named: dict[str, Study]) -> Sequence[str]:
    """The claims of a paper, and the means of its studies."""
    return [
        f"# Claims of paper {paper}",
        "",
        f"{PAPERS[paper]}.",
        "[What is judged, and how](../claims.md); [what it means](../papers/index.md).",
        "",
        "| where | what it says | what was found | by |",
        "|---|---|---|---|",
        *(_row(one, named) for one in rows if one.paper == paper),
        "",
        "## Means of all cases",
        *_means(paper, rows, named),
    ]


def _means(group: str, rows: Sequence[PaperClaim], named: dict[str, Study]) -> Iterator[str]:
    """Of the studies of a paper, or of our own."""
    yield ""
    yield "Over the runs of each case, and all of their time, with their intervals. Claims look at spans of their own, which"
    yield "are with them. Verdicts on claims that no paper makes are beneath the means. An `estimation_error` is the norm of"
    yield "the errors of all edges together; a `covariance_trace` is summed over all edges"
    yield "([quantities](../studies.md#a-study-of-your-own))."
    of_papers = _asked_by_papers(rows, named)
    for name in named:
        if group_of(name) == group and (full := record.full_study(name)):
            yield from ("", f"### {name}", "", *_whence(name, full), "", *_cases(full), *_scattered(full))
            yield from _own([claim for claim in full.claims if (name, claim.asked) not in of_papers])


def group_of(study: str) -> str:
    """The paper whose claims a study is named for, or our own."""
    return next((paper for paper in PAPERS if study.startswith(f"paper-{paper}")), OWN)


def _asked_by_papers(rows: Iterable[PaperClaim], named: dict[str, Study]) -> set[tuple[str, str]]:
    """Studies, and the digests of what papers' claims ask of them."""
    return {
        (one.study, found.judged.asked)
        for one in rows
        if one.study
        for found in verdicts(one, named[one.study])
        if found.judged
    }


def _own(judged: Sequence[JudgedClaim]) -> Iterator[str]:
    if judged:
        yield ""
        yield "| our own claim | what was found |"
        yield "|---|---|"
    for claim in judged:
        yield f"| {claim.says} | {_said('', claim)} |"


def _tally(rows: Sequence[PaperClaim], named: dict[str, Study]) -> Iterator[str]:
    """What became of claims, and what of verdicts, of which a claim has one for each case."""
    yield "A claim of a paper holds where it does in all of its cases, and by all that judges it:"
    yield ""
    yield from _table(["paper", "claims", *OUTCOMES], _by_paper(rows, lambda ours: _outcomes(ours, named)))
    yield ""
    yield "Studies give one verdict for each case of such a claim; of these:"
    yield ""
    decided = [*map(str, Decision), _NOT_FLOWN]
    yield from _table(["paper", "verdicts", *decided], _by_paper(rows, lambda ours: _decisions(ours, named)))


def _by_paper(
    rows: Sequence[PaperClaim], count: Callable[[Sequence[PaperClaim]], list[int]]
) -> Iterator[tuple[str, list[int]]]:
    for paper in PAPERS:
        numbers = count([one for one in rows if one.paper == paper])
        yield paper, [sum(numbers), *numbers]


def _outcomes(ours: Sequence[PaperClaim], named: dict[str, Study]) -> list[int]:
    came = [outcome(one, named[one.study] if one.study else None) for one in ours]
    return [came.count(what) for what in OUTCOMES]


def _decisions(ours: Sequence[PaperClaim], named: dict[str, Study]) -> list[int]:
    judged = [found.judged for one in ours if one.study for found in verdicts(one, named[one.study])]
    flown = [one.decision for one in judged if one is not None]
    return [*(flown.count(what) for what in Decision), judged.count(None)]


def _table(head: Sequence[str], rows: Iterable[tuple[str, Sequence[int]]]) -> Iterator[str]:
    yield "| " + " | ".join(head) + " |"
    yield "|---" * len(head) + "|"
    for name, numbers in rows:
        yield f"| {name} | " + " | ".join(map(str, numbers)) + " |"


def _row(one: PaperClaim, named: dict[str, Study]) -> str:
    said: list[str] = []
    by: list[str] = []
    if one.study:
        for says, all_found in groupby(verdicts(one, named[one.study]), key=attrgetter("says")):
            said += _summed_up(says if len(one.claims) > 1 else "", list(all_found))
        by.append(f"`affinet study {one.study}`" + _more(one.study, one.paper))
    if one.tests:
        said.append("holds, by tests")
        by.append(_folded([test.partition("::")[2] for test in one.tests]))
    if one.why:
        said.append(one.why if said else f"not judged: {one.why}")
    return f"| {one.where} | {one.says} | {'<br>'.join(said)} | {'<br>'.join(by)} |"


def _folded(tests: Sequence[str]) -> str:
    """How many tests there are, which opens to their names."""
    many = f"{len(tests)} test{'s' * (len(tests) > 1)}"
    return f"<details><summary>{many}</summary>{'<br>'.join(f'`{test}`' for test in tests)}</details>"


def _summed_up(says: str, cases: Sequence[Found]) -> Iterator[str]:
    """Case by case; of many that hold, how many and which."""
    holding = [found for found in cases if found.judged is not None and found.judged.decision == Decision.HOLDS]
    missing = [found for found in cases if found.judged is None]
    many = [group for group in (holding, missing) if len(group) > _MANY]
    for group in many:
        what = "holds" if group is holding else _NOT_FLOWN
        yield f"{_prefix(says)}{what} in {len(group)} of {len(cases)} cases" + _which(group, cases)
    for found in cases:
        if not any(found in group for group in many):
            yield _said(_prefix(found.case) + _prefix(says), found.judged)


def _which(group: Sequence[Found], cases: Sequence[Found]) -> str:
    return "" if len(group) == len(cases) else f" ({'; '.join(found.case for found in group)})"


def _prefix(text: str) -> str:
    return f"{text}: " if text else ""


def _said(where: str, judged: JudgedClaim | None) -> str:
    if judged is None:
        return f"{where}{_NOT_FLOWN}"
    decision = judged.decision if judged.decision == Decision.HOLDS else f"**{judged.decision}**"
    return f"{where}{decision}: {judged.found}"


def _more(study: str, paper: str) -> str:
    """Where the means of its cases are, and its picture, as far as it was flown; from the page of a paper."""
    page = "" if group_of(study) == paper else f"{group_of(study)}.md"
    links = [f"[means]({page}#{study})"] if record.full_study(study) else []
    file = PICTURES / f"{study}.png"
    links += [f"[picture](../pictures/{file.name})"] if file.exists() else []
    return f" ({', '.join(links)})" if links else ""


def _whence(name: str, full: StudyRecord) -> Iterator[str]:
    yield fill(f"{full.title} ({full.source}).", 120)
    yield ""
    yield f"{full.runs} runs of each case, intervals of {100 * full.confidence:.0f} %, from"
    yield f"[{name}.json](../../affinet/shipped/results/{name}.json);"
    yield f"`affinet study {name}` flies it again."


def _cases(full: StudyRecord) -> Iterator[str]:
    quantities = list(dict.fromkeys(case.quantity for case in full.cases))
    units = {case.quantity: f", {case.unit}" if case.unit else "" for case in full.cases}
    names = list(full.cases[0].labels)
    yield "| " + " | ".join([*names, *(f"{name}{units[name]}" for name in quantities)]) + " |"
    yield "|---" * (len(names) + len(quantities)) + "|"
    for labels in dict.fromkeys(tuple(case.labels.values()) for case in full.cases):
        means = {case.quantity: case for case in full.cases if tuple(case.labels.values()) == labels}
        yield "| " + " | ".join([*labels, *(_mean(means[name]) for name in quantities)]) + " |"


def _scattered(full: StudyRecord) -> Iterator[str]:
    """What to think of means of squares, lengths and shares whose intervals have negative numbers in them."""
    if any(
        case.low is not None
        and case.low < 0.0
        and case.quantity not in _SIGNED
        and not case.quantity.startswith(REPORT)
        for case in full.cases
    ):
        yield ""
        yield "No such quantity is negative: where an interval reaches below 0, few runs make the mean, as runs are of very"
        yield "different sizes, and it tells an order of magnitude at best. The interval is Student's, of what is symmetric."


def _mean(case: CaseMean) -> str:
    if case.found is None:
        return "no number"
    return f"{case.found:.3g}" if case.low is None else f"{case.found:.3g} ({case.low:.3g} to {case.high:.3g})"


def take(name: str, directory: Path) -> None:
    """Take in what a full study left.

    Raises
    ------
    ValueError
        When it is a quick one, or of another grid than the study has now.
    """
    kept, study = record.read(directory / record.FILE), studies.load(name)
    if kept.quick or kept.flown != record.grid(study, quick=False):
        raise ValueError(f"{directory} is not of the full study {name} as it is: fly it again")
    RESULTS.mkdir(exist_ok=True)
    shutil.copy(directory / record.FILE, RESULTS / f"{name}.json")
    for figure in directory.glob("*.png"):
        target = PICTURES / (f"{name}.png" if figure.stem == "figure" else f"{name}-{figure.name}")
        if figure.stem == "figure" or target.exists():
            shutil.copy(figure, target)


def draw_sweeps() -> None:
    """Draw the figures of sweeps as the studies do, without flying."""
    for name, study in ((name, studies.load(name)) for name in studies.shipped()):
        full = record.full_study(name)
        if full and study.along is not None and name != "bursts":  # whose picture draw_bursts.py draws
            means = [case for case in full.cases if case.quantity == study.quantity]
            report.draw_means(PICTURES / f"{name}.png", study, means)


if __name__ == "__main__":
    if sys.argv[1:] == ["--sweeps"]:
        draw_sweeps()
    for given in (one for one in sys.argv[1:] if one != "--sweeps"):
        study_name, _, folder = given.partition("=")
        take(study_name, Path(folder))
    for file, text in pages().items():
        (DOCS / file).parent.mkdir(exist_ok=True)
        (DOCS / file).write_text(text, encoding="utf-8")
