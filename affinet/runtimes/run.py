"""Fly a plan in one of the runtimes, and leave a run directory behind."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Literal, cast, get_args

from affinet.planning.plan import Plan
from affinet.planning.programs import refuse_in_process, refuse_over_processes
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.interruption import Interrupted, Interruption, interruptible
from affinet.runtimes.launcher import Launcher
from affinet.runtimes.machines.spread import Spread
from affinet.runtimes.rerun_command import NotMended, NoViewer, mend
from affinet.scenario.words import among, shown
from affinet.verdicts import outcome, timing
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.outcome import Outcome
from analysis.models.arrays import Array
from netem.core.parts import parts
from netem.medium.medium import JOURNAL
from netem.processes.system_errors import said
from netem.processes.user_code import UserCodeError
from netem.wire import keys
from world.books import history
from world.books.archive import Archive
from world.books.history import Moments
from world.recording.file import RECORDING, wrong_with

Runtime = Literal["processes", "inprocess"]
Watch = Callable[[int, float], None]


def runtime_of(word: str) -> Runtime:
    """The runtime of this name.

    Raises
    ------
    ValueError
        When there is none.
    """
    if word not in (names := get_args(Runtime)):
        raise ValueError(f"runtime {shown(word)}: {among(word, names)}")
    return cast("Runtime", word)


def fly(
    plan: Plan, runtime: Runtime, out: Path, watch: Watch, viewer: str | None = None, spread: Spread | None = None
) -> Outcome:
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
    spread
        The other machines, of a run over processes that some of them fly.

    Raises
    ------
    FileExistsError
        When `out` holds a run already.
    PlanError
        When programs of a user's own are to fly some of it in this process, or a class of this process in others.
    ValueError
        When there is no such runtime.
    OSError
        When `out` cannot be made or written to. What the system refuses later fails the run, and is told in its outcome.
    Interrupted
        When a signal asked the run to end; its outcome is written down all the same.
    """
    fly_in = _RUNTIMES[runtime_of(runtime)] if spread is None else partial(_over_processes, spread=spread)
    refuse = refuse_in_process if runtime == "inprocess" else refuse_over_processes
    refuse(plan)
    outcome.prepare(plan, out)
    with interruptible() as interruption:
        done = fly_in(plan, out, watch, viewer, interruption)
        try:
            done.save()
        except OSError as error:
            done = done.failing(f"the summary is not written: {said(error)}")
    interruption.heed()
    return done


def evidence(plan: Plan, done: Outcome) -> Evidence | None:
    """A run with the arrays in its directory; None where it left none."""
    path = Path(done.out) / history.ARRAYS
    return Evidence(plan, history.load(path), done) if path.exists() else None


def _over_processes(
    plan: Plan,
    out: Path,
    watch: Watch,
    viewer: str | None,
    interruption: Interruption,
    spread: Spread | None = None,
) -> Outcome:
    from netem.medium import journal  # pyarrow takes a while to import, and the start should not wait for it

    launcher = Launcher(plan, out, watch=watch, viewer=viewer, interruption=interruption, spread=spread)
    flight = launcher.flight
    launcher.fly()
    path, recording, book = out / history.ARRAYS, parts(out / RECORDING), out / JOURNAL
    failure, timeline, accounts = flight.failure, plan.timeline, None
    try:
        if book.exists():
            told = journal.told(book)
            timeline, accounts = timeline.facing(told.injected), told.accounts
        for trigger, tick in flight.fired.items():
            timeline = timeline.fired([trigger], tick)
    except journal.JournalError as error:
        failure = "; ".join([*filter(None, [failure]), str(error)])
    if failure and recording and wrong_with(recording[-1]):
        try:
            mend(recording[-1])  # the world was killed, or never got far: it could not close its recording
        except (NotMended, NoViewer, OSError) as error:
            failure += f"; {said(error) if isinstance(error, OSError) else error}"
    if not failure and plan.scenario.record.enabled:
        failure = wrong_with(recording[-1] if recording else out / RECORDING)
    return outcome.judge(
        plan,
        timeline,
        history.load(path, mapped=True) if path.exists() else None,
        accounts=accounts,
        uninstructed=flight.uninstructed,
        failure=failure,
        user_code=flight.user_code,
        wall_s=flight.wall_s,
        processes=flight.processes,
        refused=flight.refused,
        out=out,
        lost=flight.lost,
        timing=None if plan.pace is None else timing.of_run(out, plan.pace.factor),
    )


def _in_process(plan: Plan, out: Path, watch: Watch, viewer: str | None, interruption: Interruption) -> Outcome:
    from netem.medium import journal  # these take a second to import; over processes others need them
    from world.recording.logbook import RunWriter

    swarm, books = InProcessSwarm(plan), plan.books(viewer)
    path, flown = out / history.ARRAYS, Archive(out / history.ARRAYS, plan.world, len(plan.channels), plan.reports)
    booked: journal.Writer | None = None
    started, failure, broken = time.perf_counter(), None, None
    try:
        with (
            flown,
            journal.Writer(out / JOURNAL, plan.world.links, plan.channels, books.batch) as booked,
            RunWriter(out, keys.fresh(), plan.world, plan.channels, plan.reports, books) as logbook,
        ):

            def see(moments: Moments, next_position: Array) -> None:
                flown.extend(moments, next_position)
                logbook.write(moments, swarm.timeline)
                watch(int(moments.ticks[-1]) + 1, float(moments.error[-1]))
                interruption.heed()

            with interruption.of_what_may_last():
                broken = _broken(partial(swarm.fly, see, books.batch, booked.enter), out)
            failure = None if broken is None else str(broken)
    except Interrupted as error:
        failure = str(error)
    except OSError as error:
        failure = f"the run could not be written down: {said(error)}"
    wall_s = time.perf_counter() - started
    return outcome.judge(
        plan,
        swarm.timeline,
        history.load(path, mapped=True) if path.exists() else None,
        accounts=booked.accounts if booked else None,
        uninstructed=0,
        failure=failure,
        user_code=broken is not None,
        wall_s=wall_s,
        processes=[],
        out=out,
    )


def _broken(fly: Callable[[], None], out: Path) -> UserCodeError | None:
    """Why the swarm did not fly to the end, if a user's own code is why; its log has the traceback."""
    try:
        fly()
    except UserCodeError as error:
        log = out / "logs" / "inprocess.log"
        log.parent.mkdir(exist_ok=True)
        log.write_text("".join(traceback.format_exception(error)), encoding="utf-8", errors="backslashreplace")
        return error
    return None


_RUNTIMES: Mapping[Runtime, Callable[[Plan, Path, Watch, str | None, Interruption], Outcome]] = {
    "processes": _over_processes,
    "inprocess": _in_process,
}
