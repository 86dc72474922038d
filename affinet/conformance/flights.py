"""The flights of the suite, as scenarios: what the air does and what becomes of the process are its profiles and verbs."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from affinet.planning import designing
from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.scenario import loading
from affinet.scenario.sections import Scenario

DT = 0.05  # s

Ending = Literal["end", "orphaned", "orphaned early", "garbage", "no phase", "gap"]


@dataclass(frozen=True)
class Flight:
    """A flight of one agent under test; the others are the suite's.

    Parameters
    ----------
    name
        For people.
    ticks
        How many there are; with none it ends before the first.
    settings
        How its scenario differs from the corridor, as `--set` says it.
    agent
        Which one is under test.
    ending
        How it ends: by the phase `end`; by standard input closing, in flight or within the brief; or because, in place of the
        next inbox, there comes what is no MessagePack, of no known phase, or has a number too high.
    large
        Whether it is one of two hundred agents, in place of the corridor's seven.
    """

    name: str
    ticks: int
    settings: tuple[str, ...] = ()
    agent: int = 5
    ending: Ending = "end"
    large: bool = False

    def plan(self, estimator: str) -> Plan:
        """The plan of it.

        Raises
        ------
        ScenarioError, PlanError
            When this estimator cannot fly it.
        """
        overrides = [
            f"time.dt={DT}",
            f"time.duration={max(self.ticks, 1) * DT:g}",
            f"agents.estimator={estimator}",
            "network.availability=1",
            *self.settings,
        ]
        return planning.make(_large(overrides) if self.large else loading.load("corridor", overrides))


def _large(overrides: list[str]) -> Scenario:
    """Two hundred agents, most of them with more than fifty neighbours."""
    made = designing.designed(designing.nodes("grid", 200, 2, seed=1), reach=4.2, settle=15.0).scenario
    with tempfile.TemporaryDirectory(prefix="affinet-") as folder:
        file = Path(folder) / "grid.toml"
        file.write_text(loading.to_toml(made), encoding="utf-8")
        return loading.load(file, overrides)


def _timeline(*entries: str) -> str:
    return f"timeline=[{', '.join(f'{{{entry}}}' for entry in entries)}]"


def _at(tick: int) -> str:
    return f"{tick * DT:g}"


PLAIN = Flight("plain", 8)
UNASKED = Flight("ended before its first tick", 0)
ORPHANED = Flight("orphaned", 2, ending="orphaned")
ORPHANED_EARLY = Flight("orphaned within the brief", 0, ending="orphaned early")
GARBAGE = Flight("an inbox that is no MessagePack", 2, ending="garbage")
NO_PHASE = Flight("an inbox of no known phase", 2, ending="no phase")
GAP = Flight("an inbox that is one too far", 2, ending="gap")
LIMITED = Flight("an input limited", 3, ("agents.limit=0.01", "formation.spread=1"))
SILENT = Flight("nothing heard", 4, (_timeline(f'verb="cut",at={_at(1)},until={_at(3)},links=["all"]'),))
LATE = Flight("late broadcasts", 4, ("network.delay_ticks=1",))
DOUBLED = Flight("doubled broadcasts", 4, ("network.profiles.twice.duplicate=1", "network.profile=twice"))
CLOCK = Flight("a clock that drifts", 4, (_timeline(f'verb="clock",at={_at(1)},agents=[5],rate=0.9'),))
KILLED = Flight(
    "killed and restarted",
    6,
    (_timeline(f'verb="kill",at={_at(2)},agents=[5]', f'verb="restart",at={_at(4)},agents=[5]'),),
)
REMEMBERS = Flight(
    "restarted with what it remembers",
    6,
    (_timeline(f'verb="kill",at={_at(2)},agents=[5]', f'verb="restart",at={_at(4)},agents=[5],state="warm"'),),
)
PAUSED = Flight(
    "paused and resumed",
    6,
    (_timeline(f'verb="pause",at={_at(2)},agents=[5],in_flight="drop"', f'verb="resume",at={_at(4)},agents=[5]'),),
)
LARGE = Flight(
    "two hundred agents",
    3,
    ("agents.parameters.conral.epsilon=0.01", "agents.parameters.ga-rkf.epsilon=0.01"),
    agent=2,
    large=True,
)
SPACE = Flight("three dimensions", 3, ("formation.preset=octa10", "manoeuvre.preset=hover"), agent=8)
LEADING = Flight("a leader", 3, agent=1)
DOUBLE = Flight(
    "a double integrator",
    3,
    (
        "dynamics.model=double-integrator",
        "agents.law=double-constant-velocity",
        "manoeuvre.preset=hover",
        "agents.parameters.double-constant-velocity={position_gain=1,velocity_gain=2}",
    ),
)
