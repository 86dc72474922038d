"""A score as a page of HTML: the verdict, how it compares in every task and air, where swarms are lost, and what it costs."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import numpy as np

from affinet.score.card import Scorecard
from affinet.score.judging import CONFIDENCE, MATTERS, BreakDown, Compared, Raw, Score, point
from affinet.verdicts.page import html
from analysis.claims.paired import Comparison

# The classes of verdicts in page.css.
_KINDS = {
    Comparison.BETTER: "holds",
    Comparison.WORSE: "does-not-hold",
    Comparison.SAME: "",
    Comparison.UNDECIDED: "undecided",
}


def page(card: Scorecard, raw: Raw, score: Score, *, quick: bool) -> str:
    """The page of a score."""
    form = "a quick form" if quick else "in full"
    body = [
        f"<h1>{escape(raw.scored)}</h1><p>{escape(card.title)}, {form}: {card.seeds} runs of each, "
        "the same draws for all. Factors are of geometric means of errors over runs; their intervals hold at once with "
        f"{CONFIDENCE:.0%} confidence, and a factor up to {MATTERS:g} is no difference.</p>",
        html.section("Verdict", f"<ul>{''.join(f'<li>{escape(one)}</li>' for one in score.words)}</ul>"),
        *(html.section(f"Task: {task.name}", *_task(raw, score, task.name, task.says)) for task in card.tasks),
        html.section("Where swarms are lost", *_points(raw, score)) if score.break_downs else "",
        html.section("What it costs", _costs(raw)),
        html.section(
            "What was flown",
            html.table([[task.name, task.says] for task in card.tasks], head=["task", ""]),
            html.table([[air.name, air.says] for air in card.airs], head=["air", ""]),
            html.table([[one.name, one.says] for one in card.worsenings], head=["made worse", ""]),
        ),
    ]
    return html.document(f"{raw.scored}: score", body)


def _task(raw: Raw, score: Score, task: str, says: str) -> Iterator[str]:
    yield f"<p>{escape(says)}</p>"
    who = [name for name in raw.entrants if raw.flies(task, name)]
    if raw.scored not in who:
        return
    told = {(one.air, one.rival): one for one in score.compared if one.task == task}
    head = ["air", f"{raw.scored} (m)", *(f"against {name}" for name in who[1:])]
    rows = []
    for air in raw.airs:
        cells = [_factor(told[air, rival]) if (air, rival) in told else "<td>-</td>" for rival in who[1:]]
        rows.append(f"<tr><th>{escape(air)}</th><td>{_error(raw, task, air, raw.scored)}</td>{''.join(cells)}</tr>")
    top = "".join(f"<th>{escape(one)}</th>" for one in head)
    yield f'<div class="wide"><table><tr>{top}</tr>{"".join(rows)}</table></div>'
    errors = [[air, *(_error(raw, task, air, name) for name in who)] for air in raw.airs]
    yield html.folded(
        "Errors of all: medians (m), and the share of swarms lost", html.table(errors, head=["air", *who])
    )
    more = [[air, *_figures(raw, task, air, raw.scored)] for air in raw.airs]
    of = ["air", "squared errors over what its covariances say", "recovered after (s)", "messages that arrived"]
    yield html.folded(f"More of {raw.scored}", html.table(more, head=of))


def _factor(one: Compared) -> str:
    factor = one.factor
    says = f"{one.decision}: {factor.found:.3g} ({factor.low:.3g} to {factor.high:.3g})"
    return f'<td class="verdict {_KINDS[one.decision]}">{escape(says)}</td>'


def _error(raw: Raw, task: str, air: str, name: str) -> str:
    if not raw.flies(task, name, air):
        return "-"
    error, lost = raw.runs(task, air, name, "error"), raw.runs(task, air, name, "lost").mean()
    return f"{np.median(error):.3g}" + (f", {lost:.0%} lost" if lost else "")


def _figures(raw: Raw, task: str, air: str, name: str) -> list[str]:
    if not raw.flies(task, name, air):
        return 3 * ["-"]
    nees, recovery, delivered = (raw.runs(task, air, name, what) for what in ("nees", "recovery", "delivered"))
    return [
        "-" if np.isnan(nees).any() else f"{nees.mean():.3g}",
        "-" if np.isnan(recovery).any() else "never" if np.isinf(np.median(recovery)) else f"{np.median(recovery):.3g}",
        f"{delivered.mean():.0%}",
    ]


def _points(raw: Raw, score: Score) -> Iterator[str]:
    yield (
        "<p>The median over runs of how bad it has to be for a swarm to be lost, with its exact interval; better or worse "
        "than the others by the test of signs.</p>"
    )
    units = {one.name: f"{one.name} ({one.unit})" if one.unit else one.name for one in raw.worsenings}
    worse = {one.name: one for one in raw.worsenings}
    rows = [
        [one.task, units[one.worsening], one.entrant, point(one.median, worse[one.worsening]), _against(raw, one)]
        for one in score.break_downs
    ]
    yield html.table(rows, head=["task", "made worse", "who", "half are lost at", f"{raw.scored} is"])


def _against(raw: Raw, one: BreakDown) -> str:
    return "" if one.entrant == raw.scored or one.decision is None else one.decision.value


def _costs(raw: Raw) -> str:
    head = ["task", "who", "tick of the swarm (ms)", "messages of an agent (1/s)", "bytes of an agent (1/s)"]
    return html.table(
        (
            [task, who, f"{one.tick_s * 1e3:.3g}", f"{one.messages:.4g}", f"{one.bytes:.4g}"]
            for (task, who), one in raw.times.items()
        ),
        head,
    )
