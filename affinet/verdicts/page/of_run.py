"""A run as a page: the scene, curves, what its faults touched, its messages, its settings, and how it is flown again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np

from affinet.scenario.loading import to_toml
from affinet.verdicts import measures, told
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.page import html, scene
from netem.medium.verdict import COUNTED, Verdict
from world.books.counted import per_tick
from world.recording import palette

_MOST_IN_A_MATRIX = 40
_BIN = 0.01  # of a run, over which messages are counted for a curve


def page(run: Evidence, directory: Path) -> str:
    """The page of a run, and of the directory that it left."""
    done = run.outcome
    verdict = done.verdict.partition(",")[0]
    name = directory.absolute().name
    head = (
        f"<h1>{escape(name)}</h1>"
        f'<p><span class="verdict {verdict}">{escape(done.says)}</span> {escape(run.plan.scenario.description)}</p>'
    )
    body = [
        head,
        _scene(run),
        _curves(run),
        html.section("What came of it", _says_of_pass(verdict), html.table(_rows(run))),
        _faults(run),
        _messages(run),
        html.section("Again", html.text(f"affinet replay {shlex.quote(str(directory))} --runtime inprocess")),
        html.folded("Settings", html.text(to_toml(run.plan.scenario))),
    ]
    return html.document(name, body, scene.of_run(run))


def _says_of_pass(verdict: str) -> str:
    return f"<p>{escape(told.OF_PASS)}</p>" if verdict == "pass" else ""


def _rows(run: Evidence) -> Iterator[tuple[str, str]]:
    """What came of it, but for what has a section of its own; and what the air is, links that differ by themselves."""
    for name, says in told.rows(run):
        if not name.startswith(("fault", "jammed zone")):
            yield name, says
        if name == "network":
            yield from (("air", one.says) for one in run.plan.findings if (one.check, one.level) == ("air", "ok"))


def _scene(run: Evidence) -> str:
    occurs = [verdict for verdict in COUNTED if (run.arrays["verdicts"][:, 0] == verdict).any()]
    named = [("leader", palette.css(palette.LEADER)), ("follower", palette.css(palette.FOLLOWER))]
    named += [(verdict.label, palette.css(palette.OF_VERDICT[verdict])) for verdict in occurs]
    last = len(scene.shown(run)) - 1
    return (
        '<div class="scene"><canvas></canvas><div class="controls"><button type="button">play</button>'
        f'<input type="range" min="0" max="{last}" value="{last}" aria-label="moment"><output></output></div></div>'
        + html.key(named)
    )


def _curves(run: Evidence) -> str:
    quantity, values = measures.over_time(run.plan, run.timeline, run.arrays)
    moments = scene.shown(run)
    over = html.curves(
        quantity, run.seconds[moments], [("", palette.css(palette.FOLLOWER), values[moments])], logarithmic=True
    )
    width = max(1, round(_BIN * run.ticks))
    means = {verdict: per_tick(run.arrays["verdicts"], verdict, width) for verdict in COUNTED}
    named = [(one.label, palette.css(palette.OF_VERDICT[one]), each) for one, each in means.items() if each.any()]
    return html.section("Over time", over, html.curves("messages per tick, by verdict", run.seconds[::width], named))


def _faults(run: Evidence) -> str:
    rows = [(str(number), str(bite)) for number, bite in enumerate(run.bites, start=1)]
    rows += [("jammed zone", str(jam)) for jam in run.outcome.zones]
    return html.section("Faults, and what they touched", html.table(rows)) if rows else ""


def _messages(run: Evidence) -> str:
    messages = run.outcome.messages
    rows = [(name.replace("_", " "), str(messages[name])) for name in ("offered", "copies", "delivered", "in_flight")]
    rows += [(f"dropped, {reason}", str(number)) for reason, number in messages["dropped"].items()]
    rows.append(("lost by nobody's order", str(messages["uninstructed"])))
    matrix = _matrix(run) if run.plan.world.links.agents <= _MOST_IN_A_MATRIX else ""
    return html.section("Messages", html.table(rows), matrix)


def _matrix(run: Evidence) -> str:
    """Of each link how many of a hundred messages arrived, all channels together: a row for who hears."""
    links, verdicts = run.plan.world.links, run.arrays["verdicts"]
    offered = (verdicts != Verdict.SILENT).sum(axis=(0, 1))
    arrived = np.isin(verdicts, (Verdict.DELIVERED, Verdict.DELAYED)).sum(axis=(0, 1))
    cells = {
        (int(dst), int(src)): f"{100.0 * got / of:.0f}" if of else ""
        for dst, src, got, of in zip(links.dst, links.src, arrived, offered, strict=True)
    }
    numbers = range(1, links.agents + 1)
    head = "".join(f"<th>{number}</th>" for number in numbers)
    rows = "".join(
        f"<tr><th>{row}</th>{''.join(f'<td>{cells.get((row, column), chr(183))}</td>' for column in numbers)}</tr>"
        for row in numbers
    )
    says = "<p>Of a hundred messages so many got through: a row for who hears, a column for whom.</p>"
    return f'{says}<div class="wide"><table class="matrix"><tr><th></th>{head}</tr>{rows}</table></div>'
