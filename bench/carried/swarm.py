"""A small swarm over processes whose agents note what they hear, and the same flight in one process."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from carried import journals
from carried.journals import Noted

from affinet.planning import making
from affinet.planning.plan import Plan
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.verdicts.outcome import Outcome
from analysis.models.arrays import Integers
from netem.medium import deliveries, journal
from netem.medium.medium import JOURNAL
from world.books import history

AGENTS = 4
_SWARM = """
[formation]
nodes = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
edges = ["1-2", "1-3", "1-4", "2-3", "2-4", "3-4"]
leaders = [1, 2, 3]
[manoeuvre]
preset = "hover"
[sensing]
sigma = 0.1
[agents]
estimator = "rkf"
law = "static"
[record]
enabled = false
[network]
coupled = false
profile = "asked"
"""


class Flown(NamedTuple):
    """A flight and what it left.

    Parameters
    ----------
    plan, outcome
        What was flown, and what came of it.
    journal
        Its table.
    newest
        The tick of which the newest speaks that arrives, -1 where nothing does, shape (T, C, L).
    noted
        What its agents noted, if they did.
    deliveries
        The table of what a run in real time delivered, if it is one.
    """

    plan: Plan
    outcome: Outcome
    journal: Any
    newest: Integers
    noted: Noted | None
    deliveries: Any


def over_processes(text: str, seed: int, overrides: Sequence[str] = ()) -> Flown:
    """Fly a profile over processes, a process for each agent.

    Raises
    ------
    RuntimeError
        When the run fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = {agent: Path(folder) / f"{agent}.npz" for agent in range(1, AGENTS + 1)}
        agent = Path(__file__).parent / "agent.py"
        programs = [f'agents.programs.{n}="{sys.executable} {agent} {file}"' for n, file in files.items()]
        plan = planned(text, seed, Path(folder), [*overrides, *programs])
        outcome, out = _flown(plan, "processes", Path(folder))
        noted = journals.noted(files, plan.world.links, plan.channels, plan.world.ticks)
        real = plan.pace is not None
        return _left(plan, outcome, out, noted, deliveries.read(out / deliveries.FILE) if real else None)


def in_process(text: str, seed: int, overrides: Sequence[str] = ()) -> Flown:
    """The same in this process.

    Raises
    ------
    RuntimeError
        When the run fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        plan = planned(text, seed, Path(folder), overrides)
        return _left(plan, *_flown(plan, "inprocess", Path(folder)), None, None)


def planned(text: str, seed: int, folder: Path, overrides: Sequence[str]) -> Plan:
    """The swarm under a profile; the scenario is written into a folder."""
    file = folder / "swarm.toml"
    file.write_text(f"{_SWARM}[network.profiles.asked]\n{text}")
    return making.make(loading.load(str(file), [f"seed={seed}", *overrides]))


def _flown(plan: Plan, runtime: Any, folder: Path) -> tuple[Outcome, Path]:
    out = folder / "run"
    outcome = fly(plan, runtime, out, lambda *_: None)
    if outcome.verdict != "pass":
        raise RuntimeError(f"the flight of accuracy did not pass: {'; '.join(map(str, outcome.reasons))}")
    return outcome, out


def _left(plan: Plan, outcome: Outcome, out: Path, noted: Noted | None, delivered: Any) -> Flown:
    newest = np.asarray(history.load(out / history.ARRAYS)["newest"])
    return Flown(plan, outcome, journal.read(out / JOURNAL), newest, noted, delivered)
