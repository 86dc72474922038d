"""Any process of a run killed at any moment: nothing is left, nothing hangs, what was written can be read, the reason is right.

    python bench/kills.py [--kills 100] [--seed 1] [--only launcher,nursery,world,netem,agent] [--moments 0 6]

The victim and the moment are drawn: from the victim's start to three seconds of flight, so that many die before the first tick.
Of arrays, journal, graph and recording all is there but the last second of the run, however it was killed; `everybody` in
`--only` is all processes at once, who then leave what they had not written.
The exit status is 1 when a row is not ok. A kill is drawn from its own seed: `--kills 1 --seed N` repeats it, as far as the
machine is as fast. `ctrl-c` in `--only` interrupts the launcher in place of killing something.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import select
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
from rerun.chunk import RrdReader

from affinet.runtimes.forked import NURSERY
from netem.core import arrow
from netem.medium import journal
from netem.medium.medium import JOURNAL
from netem.processes.supervised import called
from world.books import history
from world.recording.logbook import GRAPH, GRAPH_SCHEMA, RECORDING

_ROLES = ("launcher", NURSERY, "world", "netem", "agent", "everybody")
_LIMIT_S, _FLIGHT_S, _PATIENCE_S = 5.0, 3.0, 90.0
_A_SECOND = 100  # ticks, of corridor


@dataclass
class Kill:
    """One run and how it ended: its seed, who was hit how long after its start, what was flown, and what was wrong."""

    seed: int
    role: str
    moment_s: float
    ticks: int = 0
    recorded: bool = False
    gone_s: float = 0.0
    wrong: list[str] = field(default_factory=list)


class Run:
    """A run of a scenario in a directory of its own; none of its processes outlives the block."""

    def __init__(self, folder: Path, scenario: str) -> None:
        self._folder, self.out = folder, folder / "run"
        command = [sys.executable, "-m", "affinet", "run", scenario, "--json", "--out", str(self.out)]
        with (folder / "said").open("w") as said, (folder / "complained").open("w") as complained:
            # The run's temporary directory is in its processes' environment: that tells them from all others.
            environment = os.environ | {"TMPDIR": str(folder)}
            self.launcher = subprocess.Popen(command, stdout=said, stderr=complained, env=environment)

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes():
            with suppress(psutil.NoSuchProcess):
                process.kill()
        self.launcher.wait()

    def processes(self) -> list[psutil.Process]:
        """All of this run that are alive, whoever is their parent by now."""
        return [process for process in psutil.process_iter() if self.owns(process)]

    def owns(self, process: psutil.Process) -> bool:
        """Whether it is of this run and alive: what only waits to be reaped has no environment any more."""
        return _environment(process).get("TMPDIR") == str(self._folder)

    def child(self, name: str) -> psutil.Process:
        """The process of this name, as soon as it is there."""
        found: list[psutil.Process] = []

        def there() -> bool:
            found[:] = psutil.Process(self.launcher.pid).children()  # the nursery, which has no name while it imports
            if name != NURSERY:
                forked = [child for nursery in found for child in _children(nursery)]
                found[:] = [child for child in forked if _name(child) == name]
            return bool(found)

        _await(there, f"there was no {name}")
        return found[0]

    def text(self, name: str) -> str:
        """What was written to a file beside the run."""
        return (self._folder / name).read_text()


def _environment(process: psutil.Process) -> dict[str, str]:
    try:
        return dict(process.environ())
    except (psutil.Error, OSError):
        return {}


def _children(process: psutil.Process) -> list[psutil.Process]:
    try:
        return list(process.children())
    except psutil.Error:
        return []


def _name(process: psutil.Process) -> str:
    try:
        return str(process.name())
    except psutil.Error:
        return ""


def _await(condition: Callable[[], bool], otherwise: str) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise SystemExit(otherwise)
        os.sched_yield()


@contextmanager
def flying(scenario: str) -> Iterator[Run]:
    """A run that has just been started, and its directory for as long as the block lasts."""
    with tempfile.TemporaryDirectory(prefix="kills-") as folder, Run(Path(folder), scenario) as run:
        yield run


def starts_s(scenario: str) -> dict[str, float]:
    """Seconds from a victim's start to the first tick, here and now."""
    launched = time.monotonic()
    with flying(scenario) as run:
        run.child("world")
        born = time.monotonic()
        _await((run.out / "control.json").exists, "the run never got going")
        now = time.monotonic()
    return {"launcher": now - launched, "ctrl-c": now - launched} | dict.fromkeys(_ROLES[1:], now - born)


def kill(scenario: str, seed: int, roles: tuple[str, ...], moments: Mapping[str, Sequence[float]]) -> Kill:
    """Kill one process of one run, and see what comes of it."""
    draw = random.Random(seed)
    role = draw.choice(roles)
    done = Kill(seed, role, draw.uniform(*moments[role]))
    name = called(1 + draw.randrange(7)) if done.role == "agent" else done.role
    with flying(scenario) as run:
        ours = done.role in ("launcher", "ctrl-c", "everybody")
        victim = psutil.Process(run.launcher.pid) if ours else run.child(name)
        waiting = os.pidfd_open(victim.pid)
        if select.select([waiting], [], [], done.moment_s)[0]:
            done.wrong.append("it had ended before it was killed")
        os.close(waiting)
        for process in run.processes() if done.role == "everybody" else [victim]:
            with suppress(psutil.NoSuchProcess):
                process.send_signal(signal.SIGINT if done.role == "ctrl-c" else signal.SIGKILL)
        done.gone_s, left = _gone(run)
        done.wrong += [f"left behind: {process}: {_name(process)}" for process in left]
        if done.gone_s > _LIMIT_S:
            done.wrong.append(f"it took {done.gone_s:.2f} s")
        done.wrong += _wrong_end(run, name, victim.pid)
        _read(run, done)
        if "Traceback" in run.text("complained") and done.role != "ctrl-c":
            done.wrong.append(run.text("complained"))
    return done


def _gone(run: Run) -> tuple[float, list[psutil.Process]]:
    began = time.monotonic()
    with suppress(subprocess.TimeoutExpired):
        run.launcher.wait(_LIMIT_S)
    left = run.processes()
    while left and time.monotonic() < began + _LIMIT_S:
        left = [process for process in left if run.owns(process)] or run.processes()
        os.sched_yield()
    return time.monotonic() - began, left


def _wrong_end(run: Run, name: str, pid: int) -> list[str]:
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
    if not reason.startswith(f"{name} (pid {pid}) was killed by SIGKILL"):
        wrong.append(f"the reason was: {reason}")
    return wrong if summary["verdict"] == "fail" else [*wrong, f"the verdict was {summary['verdict']}"]


def _read(run: Run, done: Kill) -> None:
    book, graph, recording = run.out / JOURNAL, run.out / GRAPH, run.out / RECORDING
    arrays, summary = run.out / history.ARRAYS, run.out / "summary.json"
    flown = summary.exists() and json.loads(summary.read_text())["wall_s"] > 0.0
    try:
        done.ticks = _last(journal.read(book)) + 1 if _has_begun(book) else 0
        kept = len(history.load(arrays)["error"]) if arrays.exists() else 0
        looked_at = _last(arrow.read(graph, GRAPH_SCHEMA)) + 1 if _has_begun(graph) else 0
        done.recorded = recording.exists() and _moments(recording) >= 0
    except (journal.JournalError, arrow.TableError, history.Damaged, RuntimeError, ValueError, Warning) as error:
        done.wrong.append(f"unreadable: {error}")
        return
    if not done.recorded and (flown or done.ticks):
        done.wrong.append("it flew, and there is no recording")
    if done.recorded and bool(_moments(recording)) != bool(done.ticks) and done.role != "everybody":
        done.wrong.append(f"{done.ticks} ticks in the journal, {_moments(recording)} moments in the recording")
    for what, ticks in (("arrays", kept), ("graph", looked_at)):
        if abs(ticks - done.ticks) > _A_SECOND:
            done.wrong.append(f"{done.ticks} ticks in the journal, and {ticks} in the {what}")


def _has_begun(table: Path) -> bool:
    return table.exists() and table.stat().st_size > 0


def _last(table: Any) -> int:
    return int(table["tick"].to_numpy().max(initial=-1))


def _moments(recording: Path) -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a recording that was never ended is read with a warning
        chunks: Any = RrdReader(str(recording)).stream().to_chunks()
    errors = (chunk for chunk in chunks if str(chunk.entity_path) == "/metrics/tracking_error")
    return sum(chunk.num_rows for chunk in errors if not chunk.is_static)


def main() -> int:
    """Kill, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=lambda roles: tuple(roles.split(",")), default=_ROLES, metavar="world,netem,...")
    parser.add_argument("--moments", type=float, nargs=2, help="seconds from the victim's start (default: measured)")
    parser.add_argument("--scenario", default="corridor")
    parser.add_argument("--verbose", action="store_true", help="a line for every kill, on standard error")
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell in the background has its children ignore it
    if options.moments:
        moments = dict.fromkeys(options.only, options.moments)
    else:
        moments = {role: (0.0, start + _FLIGHT_S) for role, start in starts_s(options.scenario).items()}
    done = []
    for seed in range(options.seed, options.seed + options.kills):
        done.append(kill(options.scenario, seed, options.only, moments))
        if options.verbose:
            print(done[-1], file=sys.stderr, flush=True)
    print("| killed | runs | before the first tick | no recording yet | readable | longest until all were gone, s | |")
    print("|---|---|---|---|---|---|---|")
    for role in options.only:
        rows = [each for each in done if each.role == role]
        early, recorded = sum(not each.ticks for each in rows), sum(each.recorded for each in rows)
        longest = max((each.gone_s for each in rows), default=0.0)
        verdict = "NOT OK" if any(each.wrong for each in rows) else "ok"
        print(f"| {role} | {len(rows)} | {early} | {len(rows) - recorded} | {recorded} | {longest:.2f} | {verdict} |")
    failed = [each for each in done if each.wrong]
    for each in failed:
        print(f"\n--seed {each.seed}: {each.role} after {each.moment_s:.3f} s: {'; '.join(each.wrong)}")
    spans = ", ".join(f"{role} {moments[role][0]:.1f} to {moments[role][1]:.1f}" for role in options.only)
    print(f"\n{len(done)} kills, {len(failed)} not ok; seconds after the victim's start: {spans}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
