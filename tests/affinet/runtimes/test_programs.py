"""A program of somebody else's, and what it starts, are stopped and end together."""

import os
import signal
import subprocess
import sys

import psutil
import pytest

from affinet.runtimes.programs import ForeignProgram, Program

WRAPPED = "import subprocess, sys\nprint(subprocess.Popen(['sleep', '600']).pid, flush=True)\n"
STAYS, LEAVES, FAILS = WRAPPED + "sys.stdin.read()", WRAPPED, WRAPPED + "sys.exit(3)"


@pytest.fixture
def started(tmp_path):
    """A program, and the process that it has started."""
    programs = []

    def started(code, kind=ForeignProgram):
        with (tmp_path / "log").open("wb") as log:
            programs.append(kind([sys.executable, "-S", "-c", code], subprocess.PIPE, log))
        return programs[-1], psutil.Process(int(programs[-1].stdout.readline()))

    yield started
    for program in programs:
        program.kill()
        program.wait()
        program.stdin.close()
        program.stdout.close()


def gone(process):
    """Whether it ends; an orphan that nobody has reaped is no process any more."""
    for _ in range(1000):
        if not process.is_running() or process.status() == psutil.STATUS_ZOMBIE:
            return True
        psutil.wait_procs([process], timeout=0.01)
    return False


@pytest.mark.parametrize("end", ["kill", "terminate"])
def test_they_end_together(end, started):
    program, its_own = started(STAYS)
    getattr(program, end)()
    assert program.wait() < 0
    assert gone(its_own)


@pytest.mark.parametrize("notice", ["wait", "poll"])
@pytest.mark.parametrize(("code", "status"), [(LEAVES, 0), (FAILS, 3)], ids=["left", "failed"])
def test_what_it_leaves_behind_ends_when_its_end_is_noticed(code, status, notice, started):
    program, its_own = started(code)
    os.waitid(os.P_PID, program.pid, os.WEXITED | os.WNOWAIT)
    assert getattr(program, notice)() == program.returncode == status
    assert gone(its_own)


def test_they_are_stopped_and_go_on_together(started):
    program, its_own = started(STAYS)
    program.send_signal(signal.SIGSTOP)
    while its_own.status() != psutil.STATUS_STOPPED:
        assert its_own.is_running()
    program.send_signal(signal.SIGCONT)
    while its_own.status() == psutil.STATUS_STOPPED:
        assert its_own.is_running()


def test_a_signal_after_its_end_reaches_nobody(started):
    program, its_own = started(LEAVES)
    program.wait()
    program.send_signal(signal.SIGTERM)
    assert program.returncode == 0
    assert gone(its_own)


def test_a_program_of_the_house_ends_alone(started):
    """The counterpart: what the nursery has forked ends in order, and not with it."""
    program, its_own = started(STAYS, Program)
    program.kill()
    program.wait()
    assert its_own.is_running()
    its_own.kill()
