"""Any process of a run killed at any moment: nothing is left, nothing hangs, what was written can be read, the reason is right.

    python bench/kills.py [--kills 100] [--seed 1] [--only launcher,nursery,world,netem,agent] [--moments 0 6]
    python bench/kills.py --over namespaces [--since start]

The victim and the moment are drawn: from the victim's start to three seconds of flight, so that many die before the first tick.
Of arrays, journal, graph and recording all is there but the last second of the run, however it was killed; `everybody` in
`--only` is all processes at once, who then leave what they had not written.

Over namespaces a run flies in real time over two machines, the medium here or there, and dies in flight; `--since start` has it
die as on one machine. `command` in `--only` is what holds seats on the other machine. There the run goes by the clock on the
wall, and what is there is compared with how far it must have been.

The exit status is 1 when a row is not ok. A kill is drawn from its own seed: `--kills 1 --seed N` repeats it, as far as the
machine is as fast. `ctrl-c` in `--only` interrupts the launcher in place of killing something.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field

import psutil
from killing import left
from killing.left import Unreadable
from killing.runs import COMMAND, DT_S, THERE, OnOneMachine, Run, Runs, name_of, over_namespaces

from affinet.runtimes.forked import NURSERY
from netem.processes.supervised import called

_ROLES = ("launcher", NURSERY, "world", "netem", "agent", "everybody")
_LIMIT_S, _FLIGHT_S = 5.0, 3.0
_IN_FLIGHT_S = (1.0, 5.0)
_A_SECOND = 100  # ticks, of corridor


@dataclass
class Kill:
    """One run and how it ended: its seed, who was hit how long after its start, what was flown, and what was wrong.

    Attributes
    ----------
    seed, role, moment_s
        Who was hit, and when: seconds after its start, or after the first tick.
    ticks, recorded
        Of which there are verdicts, and whether there is a recording.
    readable
        Whether all that it left can be read, up to the last second.
    gone_s
        How long it took until all processes were gone.
    behind_s
        How much the shortest of what it left is behind the run in real time.
    wrong
        What was.
    """

    seed: int
    role: str
    moment_s: float
    ticks: int = 0
    recorded: bool = False
    readable: bool = False
    gone_s: float = 0.0
    behind_s: float = 0.0
    wrong: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Drawing:
    """From what a kill is drawn.

    Parameters
    ----------
    runs
        Where.
    roles
        Whom.
    moments
        From when to when, in seconds, for each of them.
    in_flight
        Whether those count from the first tick, and not from the start of the victim.
    over_machines
        Whether a run flies in real time over two of them.
    """

    runs: Runs
    roles: tuple[str, ...]
    moments: Mapping[str, Sequence[float]]
    in_flight: bool
    over_machines: bool


def starts_s(runs: Runs) -> dict[str, float]:
    """Seconds from a victim's start to the first tick, here and now."""
    launched = time.monotonic()
    with runs.flying(random.Random(0)) as run:
        run.victim("world", random.Random(0))
        born = time.monotonic()
        now = run.await_flight()
    return {"launcher": now - launched, "ctrl-c": now - launched} | dict.fromkeys((*_ROLES[1:], COMMAND), now - born)


def kill(drawing: Drawing, seed: int) -> Kill:
    """Kill one process of one run, and see what comes of it."""
    draw = random.Random(seed)
    role = draw.choice(drawing.roles)
    done = Kill(seed, role, draw.uniform(*drawing.moments[role]))
    name = called(1 + draw.randrange(7)) if done.role == "agent" else done.role
    with drawing.runs.flying(draw) as run:
        began = run.await_flight() if drawing.in_flight else time.monotonic()
        victim = run.victim("launcher" if role in ("ctrl-c", "everybody") else name, draw)
        since = began if drawing.in_flight else time.monotonic()
        if _ends_before(victim, since + done.moment_s):
            done.wrong.append("it had ended before it was killed")
        for process in run.processes() if done.role == "everybody" else [victim]:
            with suppress(psutil.NoSuchProcess):
                process.send_signal(signal.SIGINT if done.role == "ctrl-c" else signal.SIGKILL)
        flown_s = time.monotonic() - began
        done.gone_s, left_behind = _gone(run)
        done.wrong += [f"left behind: {process}: {name_of(process)}" for process in left_behind]
        if done.gone_s > _LIMIT_S:
            done.wrong.append(f"it took {done.gone_s:.2f} s")
        done.wrong += _wrong_end(run, name, victim.pid, drawing.over_machines)
        unread = _unread(run, done, flown_s if drawing.in_flight and drawing.over_machines else None)
        done.readable, done.wrong = done.recorded and not unread, done.wrong + unread
        if "Traceback" in run.text("complained") and done.role != "ctrl-c":
            done.wrong.append(run.text("complained"))
    return done


def _ends_before(victim: psutil.Process, moment: float) -> bool:
    waiting = os.pidfd_open(victim.pid)
    ended = bool(select.select([waiting], [], [], max(0.0, moment - time.monotonic()))[0])
    os.close(waiting)
    return ended


def _gone(run: Run) -> tuple[float, list[psutil.Process]]:
    began = time.monotonic()
    with suppress(subprocess.TimeoutExpired):
        run.launcher.wait(_LIMIT_S)
    alive = run.processes()
    while alive and time.monotonic() < began + _LIMIT_S:
        alive = [process for process in alive if run.owns(process)] or run.processes()
        os.sched_yield()
    return time.monotonic() - began, alive


def _wrong_end(run: Run, name: str, pid: int, over_machines: bool) -> list[str]:
    status = run.launcher.poll()
    if name in ("launcher", "everybody"):
        return [] if status == -signal.SIGKILL else [f"exit status {status}"]
    if name == "ctrl-c":  # Python itself dies of the signal while it still imports
        fine = status in (130, -signal.SIGINT)
        return [] if fine else [f"exit status {status}: {run.text('complained').strip()}"]
    said = run.text("said").splitlines()
    if status != 1 or not said:
        return [f"exit status {status}, {len(said)} lines said"]
    summary = json.loads(said[-1])
    wrong = (
        [] if summary == json.loads((run.out / "summary.json").read_text()) else ["summary.json says something else"]
    )
    reason = summary["reasons"][0]
    if not _names(reason, name, pid, over_machines):
        wrong.append(f"the reason was: {reason}")
    return wrong if summary["verdict"] == "fail" else [*wrong, f"the verdict was {summary['verdict']}"]


def _names(reason: str, name: str, pid: int, over_machines: bool) -> bool:
    if name == COMMAND:
        return f"machine {THERE}: " in reason or f" on {THERE}" in reason
    where = f"(?: on {THERE})?" if over_machines else ""
    return re.search(rf"{name} \(pid {pid}{where}\) was killed by SIGKILL", reason) is not None


def _unread(run: Run, done: Kill, flown_s: float | None) -> list[str]:
    """What is wrong with what was left, of a run in real time that was flown for so long."""
    summary = run.out / "summary.json"
    flew = summary.exists() and json.loads(summary.read_text())["wall_s"] > 0.0
    try:
        ticks = left.ticks(run.out, was_ended=done.role != "everybody")
    except Unreadable as error:
        return [f"unreadable: {error}"]
    done.ticks, done.recorded = ticks.get(left.BOOK, 0), left.SEEN in ticks
    if flown_s is not None:
        done.behind_s = flown_s - DT_S * min(ticks.values(), default=0)
        late_s = left.late_s(run.out) if left.KEPT in ticks else 0.0
        return left.too_short(ticks, flown_s, late_s, DT_S)
    wrong = []
    if not done.recorded and (flew or done.ticks):
        wrong.append("it flew, and there is no recording")
    if done.recorded and bool(ticks[left.SEEN]) != bool(done.ticks) and done.role != "everybody":
        wrong.append(f"{done.ticks} ticks in the journal, {ticks[left.SEEN]} in the recording")
    return wrong + [
        f"{done.ticks} ticks in the journal, and {ticks.get(what, 0)} in the {what}"
        for what in (left.ARRAYS, left.DRAWN)
        if abs(ticks.get(what, 0) - done.ticks) > _A_SECOND
    ]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=lambda roles: tuple(roles.split(",")), metavar="world,netem,...")
    parser.add_argument("--over", choices=["namespaces"], help="two machines in real time (default: one in lockstep)")
    parser.add_argument("--since", choices=["start", "flight"], help="what moments count from (default: see above)")
    parser.add_argument("--moments", type=float, nargs=2, help="seconds from then (default: measured)")
    parser.add_argument("--scenario", default="corridor")
    parser.add_argument("--verbose", action="store_true", help="a line for every kill, on standard error")
    options = parser.parse_args()
    options.only = options.only or (_ROLES if options.over is None else (*_ROLES, COMMAND))
    options.since = options.since or ("start" if options.over is None else "flight")
    return options


def _drawing(options: argparse.Namespace, runs: Runs) -> Drawing:
    in_flight, over_machines = options.since == "flight", options.over is not None
    if options.moments or in_flight:
        moments = dict.fromkeys(options.only, options.moments or _IN_FLIGHT_S)
    else:
        moments = {role: (0.0, start + _FLIGHT_S) for role, start in starts_s(runs).items()}
    return Drawing(runs, options.only, moments, in_flight, over_machines)


def main() -> int:
    """Kill, and print the table."""
    options = _options()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell in the background has its children ignore it
    scenario = options.scenario
    done = []
    with over_namespaces(scenario) if options.over else nullcontext(OnOneMachine(scenario)) as runs:
        drawing = _drawing(options, runs)
        for seed in range(options.seed, options.seed + options.kills):
            done.append(kill(drawing, seed))
            if options.verbose:
                print(done[-1], file=sys.stderr, flush=True)
    _tell(done, drawing)
    return 1 if any(each.wrong for each in done) else 0


def _tell(done: Sequence[Kill], drawing: Drawing) -> None:
    print("| killed | runs | before the first tick | no recording yet | readable | longest until all were gone, s | |")
    print("|---|---|---|---|---|---|---|")
    for role in drawing.roles:
        rows = [each for each in done if each.role == role]
        early, unrecorded = sum(not each.ticks for each in rows), sum(not each.recorded for each in rows)
        readable, longest = sum(each.readable for each in rows), max((each.gone_s for each in rows), default=0.0)
        verdict = "NOT OK" if any(each.wrong for each in rows) else "ok"
        print(f"| {role} | {len(rows)} | {early} | {unrecorded} | {readable} | {longest:.2f} | {verdict} |")
    failed = [each for each in done if each.wrong]
    for each in failed:
        print(f"\n--seed {each.seed}: {each.role} after {each.moment_s:.3f} s: {'; '.join(each.wrong)}")
    since = "the first tick" if drawing.in_flight else "the victim's start"
    spans = ", ".join(
        f"{role} {drawing.moments[role][0]:.1f} to {drawing.moments[role][1]:.1f}" for role in drawing.roles
    )
    print(f"\n{len(done)} kills, {len(failed)} not ok; seconds after {since}: {spans}")
    if behind := max((each.behind_s for each in done), default=0.0):
        print(f"what was left ends at most {behind:.2f} s before the kill")


if __name__ == "__main__":
    sys.exit(main())
