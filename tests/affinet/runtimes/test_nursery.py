"""Processes that the nursery forks are as good as fresh ones: their own, watched, and gone when they have to be."""

import errno
import json
import os
import signal
import socket
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
from awaiting import PATIENCE, await_true
from paths import PROGRAMS

from affinet.runtimes import forked, nursery
from affinet.runtimes.child import RunFailed
from affinet.runtimes.interruption import Interruption
from affinet.runtimes.supervision import ProcessGroup

NOWHERE = Path("/nowhere")
READY = """os.write(1, b'{"event": "ready"}\\n')\n"""
HONEST = forked.program
WAITS = READY + "import time\ntime.sleep(600)"


def program(first="pass"):
    return [sys.executable, "-P", str(PROGRAMS / "scripted_nursery.py"), first, "/nowhere", "{}"]


@pytest.fixture
def crew(tmp_path, monkeypatch):
    """Makes a group with a nursery, which runs some code before anything else."""

    @contextmanager
    def make(first="pass", patience=3.0):
        monkeypatch.setattr(forked, "program", lambda *_: program(first))
        with ProcessGroup(tmp_path, patience, Interruption()) as group:
            group.start_nursery(NOWHERE)
            yield group

    return make


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """A group whose nursery many tests may have fork."""
    with pytest.MonkeyPatch.context() as patch:
        # As some parents leave it to their children: then nobody is told of the end of theirs.
        patch.setattr(
            forked, "program", lambda *_: program("import signal; signal.signal(signal.SIGCHLD, signal.SIG_IGN)")
        )
        with ProcessGroup(tmp_path_factory.mktemp("logs"), 3.0, Interruption()) as group:
            group.start_nursery(NOWHERE)
            yield group


def forked_by(group, code, number=3):
    return group.fork("agent", code, number)


def said_by(group, code, number=3):
    """What code prints in a forked process, which then ends."""
    child = forked_by(group, f"{code}\nsys.stdout.flush(); os._exit(0)", number)
    child.expected_to_die = True
    said = b""
    while chunk := os.read(child.events_fd, 1 << 16):
        said += chunk
    group._forget(child)
    assert child.process.wait() == 0, child.log.read_text()
    return said.decode().strip()


POLICY = "import os; print(os.sched_getscheduler(0))"


def test_it_does_not_interrupt_the_others_of_its_run(shared):
    assert said_by(shared, POLICY) == str(os.SCHED_BATCH)


def test_a_policy_that_a_user_has_chosen_stays(crew):
    with crew("os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))") as group:
        assert said_by(group, POLICY) == str(os.SCHED_IDLE)


# ---- as good as fresh


def test_it_has_three_descriptors_of_its_own_and_no_other(shared):
    others = [forked_by(shared, WAITS, number) for number in (1, 2)]
    listing = "paths = (f'/proc/self/fd/{descriptor}' for descriptor in range(1000))\n"
    listing += "print([os.readlink(path) for path in paths if os.path.exists(path)])"
    third, fourth = (eval(said_by(shared, listing, number)) for number in (3, 4))
    assert len({*third, *fourth}) == 6  # two pipes and a log each
    for other in others:
        shared.kill(other)


def test_it_is_one_thread_in_a_session_of_its_own_under_its_name(shared):
    told = (
        "print(len(os.listdir('/proc/self/task')), os.getsid(0) == os.getpid(), open('/proc/self/comm').read().strip())"
    )
    assert said_by(shared, told, 17) == "1 True agent 17"


def test_what_it_draws_is_not_what_the_others_draw(shared):
    alone = {"mode": "peer", "listen": {"endpoints": []}, "scouting": {"multicast": {"enabled": False}}}
    session = f"import zenoh; print(zenoh.open(zenoh.Config.from_json5({json.dumps(json.dumps(alone))})).zid())"
    for draw in ("import numpy; print(numpy.random.random())", "import random; print(random.random())", session):
        assert len({said_by(shared, draw) for _ in range(3)}) == 3


def test_its_standard_error_is_its_own_log(shared):
    said_by(shared, "print('of the fifth', file=sys.stderr)", 5)
    said_by(shared, "print('of the sixth', file=sys.stderr)", 6)
    logs = shared.children[-1].log.parent
    assert [(logs / f"agent-{number}.log").read_text() for number in (5, 6)] == ["of the fifth\n", "of the sixth\n"]


def test_it_finds_the_modules_of_the_run_imported_and_shares_their_memory(shared):
    imported = "print({'numpy', 'zenoh', 'agents.estimators.ga_rkf', 'agents.laws.double'} <= sys.modules.keys())"
    assert said_by(shared, imported) == "True"
    crew = [forked_by(shared, f"import gc; gc.collect()\n{WAITS}", number) for number in range(1, 5)]
    shared.await_ready(crew)
    memory = psutil.Process(crew[0].process.pid).memory_full_info()
    assert memory.uss < 0.25 * memory.rss, memory  # without gc.freeze() it was two thirds
    for child in crew:
        shared.kill(child)


def test_nothing_is_forked_of_threads():
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    try:
        with pytest.raises(nursery.ThreadsRun, match=r"^\d+ threads run once all is imported"):
            nursery.refuse_threads()
    finally:
        over.set()
        thread.join()


def test_a_nursery_that_runs_threads_fails_the_run_in_a_line(crew):
    waits = "import threading; threading.Thread(target=threading.Event().wait, daemon=True).start()"
    with pytest.raises(RunFailed, match=r"^nursery: 2 threads run once all is imported, .*$"), crew(waits):
        pass


# ---- how it ends


@pytest.mark.parametrize(
    ("code", "how"),
    [
        ("os._exit(3)", r"ended with exit status 3\. It had said nothing\."),
        ("sys.exit('no more')", r"ended with exit status 1\. Its last lines:\n    no more"),
        ("os.kill(os.getpid(), 11)", r"killed by SIGSEGV\. It had said nothing\."),
        ("1 / 0", r"ended with exit status 1\. Its last lines:\n(.*\n)*    ZeroDivisionError: division by zero"),
    ],
)
def test_a_death_is_told_with_its_status_and_last_lines(code, how, shared, tmp_path, monkeypatch):
    monkeypatch.setattr(shared, "_logs", tmp_path)
    child = forked_by(shared, code)
    with pytest.raises(RunFailed, match=rf"^agent 3 \(pid {child.process.pid}\) was {how}$"):
        shared.await_ready([child])


def test_it_is_paused_resumed_and_killed(shared):
    child = forked_by(shared, WAITS)
    shared.await_ready([child])
    child.pause()
    process = psutil.Process(child.process.pid)
    await_true(lambda: process.status() == psutil.STATUS_STOPPED, "it goes on")
    assert child.process.poll() is None
    child.resume()
    await_true(lambda: process.status() != psutil.STATUS_STOPPED, "it stays where it is")
    shared.kill(child)
    assert not process.is_running()
    assert child.report()["exit"] == -signal.SIGKILL


def test_what_it_held_is_freed_in_launcher_and_nursery(shared):
    holders = psutil.Process(), psutil.Process(shared._nursery.child.process.pid)
    held = [holder.num_fds() for holder in holders]
    for _ in range(30):
        shared.kill(forked_by(shared, WAITS))
    assert [holder.num_fds() for holder in holders] == held


def test_the_system_that_refuses_to_fork_is_an_error_of_the_system(crew):
    with crew("def refuse(): raise BlockingIOError(11, 'no')\nos.fork = refuse") as group:
        with pytest.raises(OSError, match="Resource temporarily unavailable") as refused:
            forked_by(group, WAITS)
        assert refused.value.errno == errno.EAGAIN
        assert not group.children


def test_there_is_none_where_nothing_is_forked(tmp_path, monkeypatch):
    with ProcessGroup(tmp_path, 3.0, Interruption()) as group:
        monkeypatch.setattr(forked.sys, "platform", "darwin")
        with pytest.raises(RunFailed, match=r"fly in one process \(runtime inprocess\)$"):
            group.start_nursery(NOWHERE)


# ---- how the nursery ends


def listen(group):
    while True:
        group.listen()


def test_a_nursery_that_dies_fails_the_run_in_a_line_and_nobody_is_left(crew):
    with crew() as group:
        children = [forked_by(group, WAITS, number) for number in (1, 2)]
        group.await_ready(children)
        children[0].pause()
        dead = group._nursery.child
        dead.process.kill()
        line = rf"^nursery \(pid {dead.process.pid}\) was killed by SIGKILL\. It had said nothing\.$"
        with pytest.raises(RunFailed, match=line):
            listen(group)
        with pytest.raises(RunFailed, match=line):
            forked_by(group, WAITS, 3)
        with pytest.raises(RunFailed, match=line):  # who dies now, nobody can say how
            group.kill(children[1])
    await_true(lambda: not any(psutil.pid_exists(child.process.pid) for child in children), "somebody is left")
    assert [report["exit"] for report in group.reports] == [None, None, -signal.SIGKILL]


def test_a_nursery_that_is_stopped_is_named_with_its_state(crew):
    with crew(patience=0.3) as group:
        child = forked_by(group, WAITS)
        group.await_ready([child])
        stopped = group._nursery.child
        stopped.pause()
        await_true(lambda: psutil.Process(stopped.process.pid).status() == psutil.STATUS_STOPPED, "it goes on")
        named = rf"^nursery \(pid {stopped.process.pid}\) is stopped \(state T\), and had not answered after 0\.3 s$"
        with pytest.raises(RunFailed, match=named):
            forked_by(group, WAITS, 4)
        with pytest.raises(RunFailed, match=named):
            group.kill(child)
    await_true(lambda: not psutil.pid_exists(child.process.pid), "it is left")
    assert stopped.process.returncode == 0


def test_it_leaves_with_a_launcher_that_is_gone(crew):
    with crew() as group:
        left = group._nursery.child
        group._nursery._connection.shutdown(socket.SHUT_RDWR)  # as the system does it
        assert left.process.wait(PATIENCE) == 0


def test_a_nursery_that_cannot_import_says_what(tmp_path, monkeypatch):
    monkeypatch.setattr(forked, "program", HONEST)
    monkeypatch.setattr(forked.nursery, "__name__", "affinet.runtimes.no_such_nursery")
    with (
        ProcessGroup(tmp_path, 3.0, Interruption()) as group,
        pytest.raises(RunFailed, match=r"(?s)^nursery \(pid \d+\) was ended with exit status 1\..*no_such_nursery"),
    ):
        group.start_nursery(NOWHERE)
