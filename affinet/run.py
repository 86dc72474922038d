"""Fly a plan in one of the runtimes, and leave a run directory behind."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from affinet import accounts, outcome
from affinet.evidence import Evidence
from affinet.inprocess import Swarm
from affinet.interruption import Interrupted, Interruption, interruptible
from affinet.launcher import Launcher
from affinet.outcome import Outcome
from affinet.plan import Plan
from affinet.rerun_command import mend
from world import history
from world.formation import Array
from world.history import History, Moments

Runtime = Literal["processes", "inprocess"]
Watch = Callable[[int, float], None]


def fly(plan: Plan, runtime: Runtime, out: Path, watch: Watch, viewer: str | None = None) -> Outcome:
    """Run a plan.

    Parameters
    ----------
    plan
        What to fly.
    runtime
        Over processes, or in this one; the answers are the same bits.
    out
        The run directory, new.
    watch
        Called with the tick reached and its tracking error, in square metres, now and then.
    viewer
        URL of a Rerun viewer that is listening.

    Raises
    ------
    FileExistsError
        When `out` holds a run already.
    Interrupted
        When a signal asked the run to end; its outcome is written down all the same.
    """
    outcome.prepare(plan, out)
    fly_in = _over_processes if runtime == "processes" else _in_process
    with interruptible() as interruption:
        done = fly_in(plan, out, watch, viewer, interruption)
        done.save()
    interruption.heed()
    return done


def rehearse(plan: Plan) -> Evidence:
    """Run a plan in this process, and leave nothing behind."""
    swarm, flown = Swarm(plan), History(plan.world, len(plan.channels), plan.reports)
    started = time.perf_counter()
    swarm.fly(flown.extend, plan.books(None).batch)
    return _judged(plan, swarm, flown, None, time.perf_counter() - started, Path())


def evidence(plan: Plan, done: Outcome) -> Evidence | None:
    """A run with the arrays in its directory; None where it left none."""
    path = Path(done.out) / history.FILE
    return Evidence(plan, history.load(path), done) if path.exists() else None


def _over_processes(plan: Plan, out: Path, watch: Watch, viewer: str | None, interruption: Interruption) -> Outcome:
    from netem import journal  # pyarrow takes a while to import, and the start should not wait for it

    flight = Launcher(plan, out, watch=watch, viewer=viewer, interruption=interruption).fly()
    path, recording, book = out / history.FILE, out / "run.rrd", out / journal.FILE
    timeline = (plan.facing(journal.injected(journal.read(book))) if book.exists() else plan).timeline
    for trigger, tick in flight.fired.items():
        timeline = timeline.fired([trigger], tick)
    if flight.failure and not path.exists() and recording.exists():
        mend(recording)  # the world was killed, or never got far: it could not close its recording
    return outcome.judge(
        plan,
        timeline,
        history.load(path) if path.exists() else None,
        in_flight=flight.in_flight,
        uninstructed=flight.uninstructed,
        failure=flight.failure,
        accounts=None if path.exists() or not book.exists() else accounts.of_journal(plan, timeline, book),
        wall_s=flight.wall_s,
        processes=flight.processes,
        out=out,
    )


def _in_process(plan: Plan, out: Path, watch: Watch, viewer: str | None, interruption: Interruption) -> Outcome:
    from world.logbook import Logbook  # takes a second to import; over processes only the world needs it

    swarm, books, flown = Swarm(plan), plan.books(viewer), History(plan.world, len(plan.channels), plan.reports)
    started, failure = time.perf_counter(), None
    with Logbook(out, out.name, plan.world, plan.channels, books) as logbook:

        def see(moments: Moments, next_position: Array) -> None:
            flown.extend(moments, next_position)
            logbook.write(moments, swarm.timeline)
            watch(int(moments.ticks[-1]) + 1, float(moments.error[-1]))
            interruption.heed()

        try:
            swarm.fly(see, books.batch)
        except Interrupted as error:
            failure = str(error)
    wall_s = time.perf_counter() - started
    flown.save(out / history.FILE)
    return _judged(plan, swarm, flown, failure, wall_s, out).outcome


def _judged(plan: Plan, swarm: Swarm, flown: History, failure: str | None, wall_s: float, out: Path) -> Evidence:
    arrays = flown.arrays()
    done = outcome.judge(
        plan,
        swarm.timeline,
        arrays,
        in_flight=None if failure else swarm.in_flight,
        uninstructed=0,
        failure=failure,
        wall_s=wall_s,
        processes=[],
        out=out,
    )
    return Evidence(plan, arrays, done)
