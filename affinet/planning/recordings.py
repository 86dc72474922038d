"""What was flown before as the air of another run: it must fit the other's clock, its links and its length."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from affinet.planning.blueprint import formation_of
from affinet.scenario import loading
from affinet.scenario.sections import Scenario, TimeSection
from affinet.scenario.wrong import ScenarioError
from analysis.models.arrays import Mask
from netem.core.links import Links
from netem.core.listing import listed
from netem.impairments.trace import Measured
from netem.medium.medium import JOURNAL

if TYPE_CHECKING:
    from netem.medium.recorded import Carried


def refuse_to_judge(before: Scenario, given: Scenario) -> None:
    """Refuse a scenario to which the verdicts of an earlier run do not apply: they are of its ticks and its links.

    Raises
    ------
    ScenarioError
        Which of them differ.
    """
    for key in ("dt", "exchange"):
        was, now = getattr(before.time, key), getattr(given.time, key)
        if was != now:
            raise ScenarioError(f"time.{key}: the verdicts are of a run with {was}, not {now}: leave it as it was")
    was, now = (set(_links(one).index) for one in (before, given))
    if strangers := sorted(was ^ now):
        what = "has no verdict on" if strangers[0] in now else "is of a run that also had"
        raise ScenarioError(f"formation: the journal {what} {_pairs(strangers)}: leave the links as they were")


def trace(run: Path, links: Links, rows: Mask, time: TimeSection, *, sensing: bool) -> tuple[Measured, list[str]]:
    """The availability that an earlier run met, and what is to be said of applying it here.

    Parameters
    ----------
    run
        Its directory.
    links, rows
        Of this run, and the ones that need a trace, shape (L,).
    time
        Of this run.
    sensing
        Whether to take what became of measurements, or of what was communicated.

    Raises
    ------
    ScenarioError
        When there is no such run.
    ValueError
        When it says nothing of a link, or ended too early.
    """
    from netem.medium import journal, recorded  # pyarrow takes a while to import

    if not (run / JOURNAL).exists():
        raise ValueError(f"the directory holds no {JOURNAL}: name that of a run, or a CSV file")
    before = loading.resolved(run)
    carried = recorded.carried(journal.read(run / JOURNAL), links, sensing=sensing)
    if silent := [pair for pair, row in links.index.items() if rows[row] and not carried.known[row]]:
        raise ValueError(f"the run has no verdict on {_pairs(silent)}")
    flown = len(carried.share) * before.time.dt
    if flown < (1.0 - 1e-9) * time.duration:
        raise ValueError(f"the run ends after {flown:g} s, this one after {time.duration:g} s; shorten time.duration")
    return _changes(carried, before.time.dt), _notes(before, carried, links, rows, time)


def _changes(carried: Carried, dt: float) -> Measured:
    share = carried.share
    changes = np.concatenate([np.ones_like(share[:1], dtype=bool), share[1:] != share[:-1]])
    tick, link = np.nonzero(changes)
    return Measured(np.asarray(tick * dt, dtype=np.float64), link, share[tick, link])


def _notes(before: Scenario, carried: Carried, links: Links, rows: Mask, time: TimeSection) -> list[str]:
    notes = []
    if before.time.dt != time.dt:
        notes.append(
            f"it was flown at dt {before.time.dt:g} s, and this run has {time.dt:g} s: each tick has its mean over time"
        )
    if others := sorted(set(_links(before).index) ^ set(links.index)):
        notes.append(
            f"it was flown over other links ({_pairs(others)} are in one alone): they go by the agents' numbers"
        )
    if untold := float(carried.untold[:, rows].mean()) if rows.any() else 0.0:
        notes.append(
            f"in {untold:.2%} of its ticks and links nothing was offered, or a fault held it: there all passes"
        )
    return notes


def _links(given: Scenario) -> Links:
    formation = formation_of(given)
    return Links.both_ways(formation.agents, formation.edges)


def _pairs(pairs: Sequence[tuple[int, int]]) -> str:
    return listed(f"{src}->{dst}" for src, dst in pairs)
