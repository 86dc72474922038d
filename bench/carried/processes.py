"""Accuracy over processes: what agents hear over Zenoh is what the journal says, and the journal has what was asked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import arriving
import numpy as np
from against import Against, Row
from carried import asked, journals, swarm
from carried.asked import Asked, Queue
from carried.swarm import Flown
from scipy import stats

from analysis.models.arrays import Integers
from netem.impairments.chain import all_together
from netem.impairments.corrupt import Mark
from netem.impairments.loss import bernoulli, gilbert_elliott
from netem.medium.medium import JOURNAL
from world.books.history import ARRAYS

DT = 0.05
_MESSAGES = 36  # of a tick: three channels of twelve links

CASES = (
    Asked(
        "Gilbert 1/16, 1/4; 100 ms exponentially; 0.1 twice; stale 0.05, bias 0.05",
        """
loss = [{ model = "gilbert-elliott", p = 0.0625, r = 0.25 }]
delay = { model = "exponential", mean = 0.1 }
duplicate = 0.1
corrupt = [{ kind = "stale", p = 0.05 }, { kind = "bias", p = 0.05, by = 0.001 }]
""",
        gilbert_elliott(0.0625, 0.25),
        stats.expon(0.0, 0.1).cdf,
        0.1,
        {Mark.STALE: 0.05, Mark.BIAS: 0.05},
    ),
    Asked(
        "0.5; Gilbert 0.05, 0.5; 75 +- 75 ms",
        """
loss = [{ model = "bernoulli", p = 0.5 }, { model = "gilbert-elliott", p = 0.05, r = 0.5 }]
delay = { model = "uniform", mean = 0.075, jitter = 0.075 }
""",
        all_together((bernoulli(0.5), gilbert_elliott(0.05, 0.5))),
        stats.uniform(0.0, 0.15).cdf,
    ),
    Asked(
        "Gilbert 1/16, 1/4; 12000 bit/s, 300 B wait",
        """
loss = [{ model = "gilbert-elliott", p = 0.0625, r = 0.25 }]
rate = { rate = 12000, queue = 300 }
""",
        gilbert_elliott(0.0625, 0.25),
        queue=Queue(75, 300, (48, 80)),
    ),
)


def check(verdicts: int, seed: int) -> Iterator[Row]:
    """Each profile, flown over processes, and in one; of so many messages in all."""
    for number, case in enumerate(CASES):
        ticks = -(-verdicts // (len(CASES) * _MESSAGES))
        clock = (f"time.dt={DT}", f"time.duration={ticks * DT}")
        over, alone = (fly(case.text, seed + number, clock) for fly in (swarm.over_processes, swarm.in_process))
        yield from of_a_flight(case, over, alone)


def of_a_flight(case: Asked, over: Flown, alone: Flown) -> Iterator[Row]:
    """A flight over processes against its journal, against the same in one process, and against what was asked."""
    world = over.plan.world
    against, noting = (Against("over processes", case.parameters, file) for file in (JOURNAL, "noted by agents"))
    made = journals.verdicts(over.journal, world.links, over.plan.channels, world.ticks)
    assert over.noted is not None
    due, heard = over.noted.of_these(arriving.expected(made)), over.noted.arrived
    yield noting.exactly("messages heard", float(len(due)), float(len(heard)))
    yield noting.exactly("heard other than the journal says", 0.0, float(arriving.apart(due, heard)))
    newest = newest_heard(heard, over.newest.shape)
    yield replace(noting, file=ARRAYS).exactly("newest other than heard", 0.0, float((over.newest != newest).sum()))
    same = over.journal.equals(alone.journal) and over.outcome.digest == alone.outcome.digest
    yield against.exactly("journal and digest are those in one process", 1.0, float(same))
    yield from asked.rows(against, case, made, DT)


def newest_heard(arrived: Integers, shape: tuple[int, ...]) -> Integers:
    """The tick of which the newest speaks that was heard, -1 where nothing was, shape (T, C, L)."""
    newest = np.full(shape, -1)
    np.maximum.at(newest, (arrived[:, 0], arrived[:, 2], arrived[:, 3]), arrived[:, 1])
    return newest
