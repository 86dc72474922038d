"""Long runs: what a process holds does not grow, and whatever happens to the machine leaves what was recorded."""

import ast
import json
import mmap
import os
import resource
import shutil
import socket
import subprocess
import sys
from math import prod

import numpy as np
import psutil
import pytest
from flying import PROCESSES, plan_of
from limits import limit
from paths import BENCH, ROOT

from affinet.runtimes.run import fly
from netem.core import arrow
from netem.medium import journal
from netem.medium.medium import JOURNAL
from world.books.archive import Archive
from world.books.history import ARRAYS, forms, load
from world.recording.file import wrong_with
from world.recording.logbook import GRAPH, GRAPH_SCHEMA

pytestmark = PROCESSES

LONG = ("time.duration=6", "record.enabled=false", 'agents.estimator="none"')  # 6,000 ticks
SETTLED = 2000  # ticks


def held(plan):
    """Bytes of all that happens in a tick."""
    arrays = forms(plan.world, len(plan.channels), plan.reports).values()
    return sum(array.dtype.itemsize * prod(array.shape[1:]) for array in arrays)


def growth(plan, out, meanwhile=lambda: None):
    """By how much the memory of this process has grown between tick 2,000 and the end of a flight."""
    us, seen = psutil.Process(), []

    def watch(tick, _):
        meanwhile()
        if tick >= SETTLED:
            seen.append(us.memory_info().rss)

    assert fly(plan, "inprocess", out, watch).verdict == "pass"
    return max(seen) - seen[0]


def test_what_happens_is_not_held_in_memory(out):
    """Before: all of it was, to the end."""
    plan = plan_of("rigid", *LONG)
    all_of_it = held(plan) * (plan.world.ticks - SETTLED)
    assert all_of_it > 20e6
    assert growth(plan, out) < all_of_it / 4


def test_whoever_holds_it_is_seen(out):
    plan, leak = plan_of("rigid", *LONG), []
    batch = held(plan) * plan.books(None).batch

    def hold():  # in pages of its own: what others have given back would be taken before the process grows
        leak.append(mmap.mmap(-1, batch))
        leak[-1].write(b"x" * batch)

    assert growth(plan, out, hold) > held(plan) * (plan.world.ticks - SETTLED) / 2


@pytest.mark.slow
@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_no_process_grows_while_something_fails_every_second(runtime):
    bench = [sys.executable, str(BENCH / "endurance.py"), runtime, "--ticks", "30000"]
    done = subprocess.run(bench, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


# ---- what happens to the machine: the table of docs/endurance.md


def readable(out):
    """How many ticks are there of what happened, of the journal, and of the graph."""
    arrays = load(out / ARRAYS)
    book, graph = journal.read(out / JOURNAL), arrow.read(out / GRAPH, GRAPH_SCHEMA)
    assert len({len(array) - (name == "position") for name, array in arrays.items()}) == 1
    return len(arrays["error"]), *(int(np.max(table["tick"].to_numpy(), initial=-1)) + 1 for table in (book, graph))


FULL = """
import json, sys
from pathlib import Path
from affinet.planning import making
from affinet.runtimes.run import fly
from affinet.scenario import loading
plan = making.make(loading.load("corridor", ["time.dt=0.05", "time.duration=60"]))
print(json.dumps(fly(plan, sys.argv[1], Path(sys.argv[2]) / "run", lambda *_: None).reasons))
"""
SMALL_DISK = 'mount -t tmpfs -o size=2m none "$0" && "$1" -c "$2" "$3" "$0" && cp -r "$0"/run "$4"'


def may_mount():
    mount = ["unshare", "-m", "mount", "-t", "tmpfs", "none", "/mnt"]
    return shutil.which("unshare") and not subprocess.run(mount, check=False, capture_output=True).returncode


@pytest.mark.skipif(not may_mount(), reason="nobody but root may mount a small disk")
@pytest.mark.parametrize("runtime", ["inprocess", pytest.param("processes", marks=pytest.mark.slow)])
def test_a_disk_that_is_full_ends_the_run_and_leaves_what_was_written(runtime, tmp_path):
    (tmp_path / "disk").mkdir()
    command = [
        "unshare",
        "-m",
        "sh",
        "-c",
        SMALL_DISK,
        str(tmp_path / "disk"),
        sys.executable,
        FULL,
        runtime,
        str(tmp_path),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    reason = json.loads(done.stdout)[0]
    assert "No space left on device; free some room" in reason or "was the disk full" in reason
    ticks, booked, looked_at = readable(tmp_path / "run")
    assert 0 < ticks < 1200
    assert abs(ticks - booked) <= 20
    assert ticks - 20 <= looked_at <= ticks


def test_too_few_descriptors_on_the_way_end_the_run_with_the_way_out(out, monkeypatch):
    extend = Archive.extend

    def short_of_them(self, *given):
        with limit(resource.RLIMIT_NOFILE, len(os.listdir("/proc/self/fd")) + 5):
            extend(self, *given)

    monkeypatch.setattr(Archive, "extend", short_of_them)
    done = fly(plan_of("corridor", "time.dt=0.05", "time.duration=2", "record.enabled=false"), "inprocess", out, print)
    assert done.verdict == "fail"
    assert done.reasons[0].endswith("Too many open files; raise the limit of open files (ulimit -n)")
    assert journal.read(out / JOURNAL).num_rows > 0


VIEWER = """
import sys, rerun
stream = rerun.RecordingStream("viewer")
print(stream.serve_grpc(grpc_port=int(sys.argv[1])), flush=True)
sys.stdin.read()
"""


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_a_viewer_that_goes_away_is_not_missed(out):
    port = free_port()
    viewer = subprocess.Popen(
        [sys.executable, "-c", VIEWER, str(port)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        viewer.stdout.readline()

        def end_it(tick, _):
            if tick >= 40:
                viewer.kill()

        plan = plan_of("corridor", "time.dt=0.05", "time.duration=6", "record.every=1")
        done = fly(plan, "inprocess", out, end_it, viewer=f"rerun+http://127.0.0.1:{port}/proxy")
    finally:
        viewer.kill()
        viewer.communicate()
    assert done.verdict == "pass"
    assert wrong_with(out / "run.rrd") is None
    assert readable(out) == (120, 120, 120)


CLOCKS = {"time", "time_ns", "ctime", "localtime", "gmtime", "strftime", "now", "utcnow", "today", "clock_gettime"}
NAMED_BY_THE_DAY = {
    "affinet/runtimes/directories.py",  # runs/corridor-20261130-120000
    "netem/wire/authority.py",  # certificates are valid from now on
    "netem/wire/certificates.py",
}


def looked_at_the_clock(text):
    """The calls by which a module asks what time of the day it is."""
    return sorted(
        ast.unparse(node.func)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in CLOCKS
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id in {"time", "datetime", "date"}
    )


def test_nothing_depends_on_the_time_of_the_day():
    """A clock that is stepped while a run flies changes nothing: nobody looks at it."""
    rooms = ("affinet/runtimes", "agents", "analysis", "netem", "world")
    files = [file for room in rooms for file in (ROOT / room).rglob("*.py")]
    looking = {str(file.relative_to(ROOT)) for file in files if looked_at_the_clock(file.read_text())}
    assert len(files) > 100
    assert looking == NAMED_BY_THE_DAY
    planted = "import time\nfrom datetime import datetime\ndeadline = time.time() + 3\nbegan = datetime.now()\n"
    assert looked_at_the_clock(planted) == ["datetime.now", "time.time"]
    assert not looked_at_the_clock("time.monotonic() + time.perf_counter() + time.process_time()")
