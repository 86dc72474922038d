"""The accounts of a run from its journal, where that is all it left."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from affinet.planning.plan import Plan
from netem.faults.timeline import Timeline
from netem.medium.medium import Medium
from netem.medium.verdict import Fate, Ledger


@dataclass(frozen=True)
class Accounts:
    """How far a run came, and its messages.

    Parameters
    ----------
    ticks
        That are accounted for.
    ledger
        What became of the messages offered in them.
    in_flight
        Messages under way after them.
    """

    ticks: int
    ledger: Ledger
    in_flight: int


def of_journal(plan: Plan, timeline: Timeline, path: Path) -> Accounts:
    """The accounts of a run whose world was killed: its verdicts are given again, and what was under way is delivered again.

    Parameters
    ----------
    plan
        What was flown.
    timeline
        Its faults, where they came to lie.
    path
        The journal.

    Raises
    ------
    netem.medium.journal.JournalError
        When it is none.
    """
    from netem.medium import journal  # pyarrow takes a while to import, and few runs need it

    recorded = journal.Recorded(journal.read(path), plan.world.links, plan.channels)
    medium = Medium(plan.scenario.seed, plan.channels, plan.profiles, timeline, recorded)
    air, ticks = medium.begin(), len(recorded.fate)
    copies, late = np.zeros(ticks, dtype=np.int64), np.zeros(ticks, dtype=np.int64)
    dropped = np.zeros((ticks, len(Fate)), dtype=np.int64)
    for tick in range(ticks):
        air, verdicts = medium.judge(air, tick, recorded.fate[tick] != Fate.SILENT, None)
        air, delivery = medium.deliver(air, tick, verdicts)
        copies[tick] = np.count_nonzero(verdicts.copy_due >= 0)
        late[tick] = delivery.late
        dropped[tick] = np.bincount(delivery.dropped[:, -1], minlength=len(Fate))
    return Accounts(ticks, Ledger.of(recorded.fate, copies, late, dropped), air.in_flight)
