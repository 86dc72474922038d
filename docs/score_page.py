"""docs/built-in.md: which of the built-in estimators to use, and when, from a full score.

affinet score ga-rkf --out SCORE
python docs/score_page.py SCORE      take in what was flown: docs/built-in.json, and the picture
python docs/score_page.py            write the page from that
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from marked import Lines, code, filled, table, titled
from matplotlib.figure import Figure

from affinet.score import card as cards
from affinet.score.judging import ASTRAY, CONFIDENCE, MATTERS, break_down, point
from analysis.claims import paired
from analysis.claims.intervals import Interval
from analysis.claims.paired import Comparison

DOCS = Path(__file__).parent
KEPT, PAGE, PICTURE = DOCS / "built-in.json", DOCS / "built-in.md", DOCS / "pictures" / "break-down.png"
CARD = "edges"
# From no estimator to the most elaborate.
_ORDER = ["none", "rkf", "imm", "ral", "conral", "ga-rkf", "edge-kf", "joint-kf", "silent-kf"]
# Of the scores taken in; tests/project/test_built_in.py holds each sentence against them.
_ANSWER = (
    "Of single integrators that tell each other their inputs, `edge-kf` or `joint-kf`, which are as good as each other: among "
    "the best more often than any other, with errors a fifth to two fifths smaller than those of `ga-rkf` in perfect air and "
    "for one that is blind.",
    "But they do not bear what they cannot predict: both lose the formation where what is communicated is late and "
    "measurements are not, where a neighbour dies, and in the corridor in an outage of 9 s.",
    "`ga-rkf`, for all else: of those that fly every task it is among the best most often, and nobody beats it in bursts, on "
    "a busy wireless network, over two hops, with delays, and when somebody dies.",
    "`rkf` is as good where every other message is lost, each for itself, and costs less; what lasts it does not bear: it "
    "loses the formation in an outage of 13 s in the plane and of 6 s in space, and in bursts of six ticks.",
    "`imm` bears the most losses in the corridor, the filters of edges in turns: about one message in seven getting through. "
    "`imm` is worse than `ga-rkf` as soon as losses come in bursts.",
    "`conral` is as good as `ga-rkf` in bursts, and worse where losses are many and each for itself; it does not filter noise.",
    "`ral`, `none` and in the corridor `silent-kf` bear no losses to speak of in the plane; nobody bears nineteen in twenty "
    "anywhere.",
    "Nobody's covariances tell the truth under all of this: those of `ga-rkf` are too small in a third of the airs, those of "
    "`conral` in more than half, those of the filters of edges in nearly all.",
)
_COLOURS = ("C7", "C1", "C4", "C2", "C0", "C3", "C5", "C6", "C8")


def take_in(score: Path) -> None:
    """What a full score came to, in so far as the page says it, and the picture."""
    said = json.loads((score / "score.json").read_text(encoding="utf-8"))
    if said["size"] != "full":
        sys.exit(f"{score}: a quick score; fly it in full")
    kept = {
        "seeds": said["seeds"],
        "flies": said["flies"],
        "cells": list(_best(said)),
        "points": list(_points(said)),
        "verdict": said["verdict"],
    }
    KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    _draw(kept)


def _points(said: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Of each task, of what is made worse, and of each entrant: how bad it has to be for half of the swarms to be lost."""
    worse = {one.name: one for one in cards.load(CARD).worsenings}
    for one in said["break_downs"]:
        found = break_down([_number(value) for value in one["runs"]], worse[one["worsening"]])
        ends = {"found": found.found, "low": found.low, "high": found.high}
        median = {name: str(value) if np.isinf(value) else value for name, value in ends.items()}
        yield {**{name: one[name] for name in ("task", "worsening", "entrant")}, "median": median}


def _best(said: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Of each task and air: every entrant's median error and share lost, and who is as good as any."""
    lost_beyond = {task.name: ASTRAY * task.lost for task in cards.load(CARD).tasks}
    cells: dict[tuple[str, str], dict[str, Mapping[str, Any]]] = {}
    for one in said["cells"]:
        if one["unsuited"] is None:
            cells.setdefault((one["task"], one["air"]), {})[one["entrant"]] = one["runs"]
    pairs = sum(len(those) * (len(those) - 1) for those in cells.values())
    for (task, air), those in cells.items():
        errors = {who: np.array([_number(value) for value in runs["error"]]) for who, runs in those.items()}
        worse = {
            who
            for who in errors
            for other in errors
            if who != other
            and paired.compared(paired.ratio(errors[other], errors[who], lost_beyond[task], pairs, CONFIDENCE), MATTERS)
            is Comparison.BETTER
        }
        yield {
            "task": task,
            "air": air,
            "entrants": {
                who: {
                    "error": _plain(float(np.median(values))),
                    "lost": float(np.mean(those[who]["lost"])),
                    "nees": _plain(float(np.mean([_number(one) for one in those[who]["nees"]]))),
                    "best": who not in worse,
                }
                for who, values in errors.items()
            },
        }


def page() -> str:
    """The page, from what was taken in."""
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    card = cards.load(CARD)
    return "\n".join([*_page(kept, card)]) + "\n"


def _page(kept: Mapping[str, Any], card: cards.Scorecard) -> Lines:
    yield from titled(
        "Which estimator, and when?",
        filled(
            "The estimators of relative positions that come with affinet, those of paper 000 and the filters of edges of "
            f"papers 001 and 004, scored against each other: {len(card.tasks)} tasks, {len(card.airs)} airs, "
            f"{kept['seeds']} runs of each, the same draws for all ([score](score.md)). Filters of edges predict by "
            "velocities, and fly single integrators; `crkf`, which hears everybody past the air, is not among them. "
            f"Who is among the best is nowhere beaten by more than a factor of {MATTERS:g}, as far as {CONFIDENCE:.0%} "
            "confidence for all comparisons at once can tell. Ticks are 0.05 s long. `docs/score_page.py` writes this page "
            "from `docs/built-in.json`, which it takes from a score."
        ),
    )
    yield from ["", "## The answer", ""]
    yield from (filled(f"- {one}").replace("\n", "\n  ") for one in _ANSWER)
    yield from ["", "## Air by air", ""]
    yield from (filled(f"- {one}").replace("\n", "\n  ") for one in _words(kept, card))
    yield from [
        "",
        "## Where swarms are lost",
        "",
        f"![Break-down points of every estimator](pictures/{PICTURE.name})",
        "",
    ]
    yield filled(
        "How bad it has to be for half of the swarms to be lost: the median over the runs, with its exact interval of "
        "95 %. Beyond what was tried there is an arrow."
    )
    yield ""
    most = {one.name: one for one in card.worsenings}
    units = {name: f"{name} ({one.unit})" if one.unit else name for name, one in most.items()}
    yield from table(
        ("task", "made worse", *_entrants(kept)),
        (
            [task, units[worse], *(_point(kept, task, worse, who, most[worse]) for who in _entrants(kept))]
            for task, worse in dict.fromkeys((one["task"], one["worsening"]) for one in kept["points"])
        ),
    )
    for task in card.tasks:
        those = [one for one in kept["cells"] if one["task"] == task.name]
        who = [name for name in _entrants(kept) if any(name in one["entrants"] for one in those)]
        yield from ["", f"## {task.name.capitalize()}", ""]
        yield filled(
            f"{task.says.capitalize()}. Median error over the runs, in metres, and the share of swarms that were lost "
            f"(more than {task.lost:g} m off at the end); those among the best in bold."
        )
        yield ""
        yield from table(
            ("air", *who), ([one["air"], *(_cell(one["entrants"].get(name)) for name in who)] for one in those)
        )
    yield from ["", "## The airs", ""]
    yield from table(("air", "what"), ((one.name, one.says) for one in card.airs))


def _words(kept: Mapping[str, Any], card: cards.Scorecard) -> Iterator[str]:
    flown = {who: [one["entrants"][who] for one in kept["cells"] if who in one["entrants"]] for who in _entrants(kept)}
    best = {who: sum(one["best"] for one in those) for who, those in flown.items()}
    ranked = sorted(flown, key=lambda who: -best[who] / len(flown[who]))
    counts = ", ".join(f"{code(who)} {best[who]} of {len(flown[who])}" for who in ranked)
    yield f"among the best in so many tasks and airs: {counts}"
    for air in card.airs:
        those = [one["entrants"] for one in kept["cells"] if one["air"] == air.name]
        always = [who for who in flown if all(one[who]["best"] for one in those if who in one)]
        says = ", ".join(map(code, always)) or "nobody"
        yield f"{air.name} ({air.says}): among the best in every task {'is' if len(always) == 1 else 'are'} {says}"
    sure = {who: sum((one["nees"] or 0.0) > MATTERS for one in those) for who, those in flown.items()}
    counts = ", ".join(f"{code(who)} {number} of {len(flown[who])}" for who, number in sure.items())
    yield f"squared errors are larger than the covariances say, by more than a tenth, in so many: {counts}"


def _entrants(kept: Mapping[str, Any]) -> list[str]:
    return sorted(dict.fromkeys(who for one in kept["cells"] for who in one["entrants"]), key=_ORDER.index)


def _cell(one: Mapping[str, Any] | None) -> str:
    if one is None:
        return "-"
    error = "lost" if one["error"] is None else f"{one['error']:.3g}"
    says = error + (f", {one['lost']:.0%}" if one["lost"] else "")
    return f"**{says}**" if one["best"] else says


def _point(kept: Mapping[str, Any], task: str, worse: str, who: str, made: cards.Worsening) -> str:
    for one in kept["points"]:
        if (one["task"], one["worsening"], one["entrant"]) == (task, worse, who):
            return point(_interval(one["median"]), made)
    return "-"


def _draw(kept: Mapping[str, Any]) -> None:
    """A panel for each task and what is made worse, a row for each estimator."""
    card, who = cards.load(CARD), _entrants(kept)
    mpl.rcParams.update({"font.size": 8, "axes.grid": True, "grid.alpha": 0.3})
    figure = Figure(figsize=(10.0, 1.0 + 0.2 * len(who) * len(card.tasks)), layout="constrained", dpi=160)
    panels = figure.subplots(len(card.tasks), len(card.worsenings), squeeze=False, sharey=True)
    for row, task in enumerate(card.tasks):
        for column, worse in enumerate(card.worsenings):
            panel = panels[row, column]
            for place, name in enumerate(who):
                _mark(panel, place, worse, _COLOURS[place], _found(kept, task.name, worse.name, name))
            panel.set_yticks(range(len(who)), who)
            panel.set_xlim(max(worse.least, 0.0) or 0.0, worse.most * 1.08)
            if worse.least > 0.0:
                panel.set_xscale("log")
                panel.set_xlim(worse.least, worse.most * 1.3)
            panel.set_title(f"{task.name}: {worse.name}" + (f" ({worse.unit})" if worse.unit else ""), fontsize=8)
    panels[0, 0].invert_yaxis()
    figure.savefig(PICTURE, metadata={"Software": None})


def _found(kept: Mapping[str, Any], task: str, worse: str, who: str) -> Interval | None:
    for one in kept["points"]:
        if (one["task"], one["worsening"], one["entrant"]) == (task, worse, who):
            return _interval(one["median"])
    return None


def _mark(panel: Any, place: int, worse: cards.Worsening, colour: str, found: Interval | None) -> None:
    if found is None:
        return
    low = max(found.low, worse.least if worse.least > 0.0 else 0.0)
    high = min(found.high, worse.most)
    panel.plot([low if np.isfinite(low) else worse.most, high], [place, place], color=colour, lw=2)
    beyond = np.isinf(found.found)
    panel.plot([worse.most if beyond else found.found], [place], ">" if beyond else "o", color=colour, ms=5)


def _interval(one: Mapping[str, Any]) -> Interval:
    return Interval(*(_number(one[name]) for name in ("found", "low", "high")))


def _number(value: float | str | None) -> float:
    return np.nan if value is None else float(value)


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None


def main(given: Sequence[str]) -> None:
    """Write the page."""
    for directory in given:
        take_in(Path(directory))
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
