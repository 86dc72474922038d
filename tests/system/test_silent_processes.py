"""Who holds a swarm up is named: processes that only beat, sleep, compute or are stopped."""

import json
import os
import signal
import sys
import time

import pytest

from affinet.runtimes.child import RunFailed
from affinet.runtimes.interruption import Interruption
from affinet.runtimes.supervision import ProcessGroup

SHORT = 1.2
BEATS = "import sys, time\nwhile True: print(sys.argv[1], flush=True); time.sleep(0.2)"


def beating(crew, role, *whom, number=None):
    beat = json.dumps({"event": "beat", "k": 7, "what": "what it owes", "waits": whom})
    return crew.start(role, [sys.executable, "-S", "-c", BEATS, beat], {}, number)


def swarm(crew):
    world = beating(crew, "world", "agent 1", "agent 2")
    medium = beating(crew, "netem", "agent 2")
    beating(crew, "agent", "netem", number=1)
    return world, medium


def blamed(crew, awaited):
    while True:
        crew.listen()
        crew.blame_the_silent(awaited)


@pytest.mark.parametrize("foreign", [True, False], ids=["which does not beat", "which beat before"])
def test_a_stopped_agent_is_named_with_its_state_and_who_waits_for_it(foreign, tmp_path):
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        awaited = swarm(crew)
        agent = crew.start("agent", ["sleep", "600"], {}, 2) if foreign else beating(crew, "agent", "netem", number=2)
        while not all(child.doing for child in crew.children if not foreign or child is not agent):
            crew.listen()
        os.kill(agent.process.pid, signal.SIGSTOP)
        with pytest.raises(RunFailed) as failure:
            blamed(crew, awaited)
    said = str(failure.value)
    assert said.startswith(f"agent 2 (pid {agent.process.pid}) is stopped (state T): nothing moved for ")
    assert (
        "; world waits for agent 1, agent 2 (what it owes, tick 7); netem waits for agent 2 (what it owes, tick 7)"
        in said
    )


def test_a_foreign_agent_that_sleeps_on_is_named(tmp_path):
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        awaited = swarm(crew)
        agent = crew.start("agent", ["sleep", "600"], {}, 2)
        with pytest.raises(
            RunFailed, match=rf"^agent 2 \(pid {agent.process.pid}\) sleeps \(state S\): nothing moved for "
        ):
            blamed(crew, awaited)


def test_a_foreign_agent_that_computes_for_ever_is_named(tmp_path):
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        awaited = swarm(crew)
        crew.start("agent", [sys.executable, "-S", "-c", "while True: pass"], {}, 2)
        with pytest.raises(RunFailed, match=r"^agent 2 \(pid \d+\) computes \(state R\): nothing moved for "):
            blamed(crew, awaited)


def test_a_medium_with_code_of_a_users_own_is_not_trusted_to_end(tmp_path):
    """Before: a loss without an end was waited for without an end."""
    computes = [sys.executable, "-S", "-c", "while True: pass"]
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        medium = crew.start("netem", computes, {})
        with pytest.raises(RunFailed, match=r"^netem \(pid \d+\) computes \(state R\): nothing moved for "):
            blamed(crew, [medium])
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        medium = crew.start("netem", computes, {})
        medium.trusted = True
        while crew.now_s < 3 * SHORT:
            crew.listen()
            crew.blame_the_silent([medium])


def test_where_all_wait_for_each_other_it_is_said_for_whom(tmp_path):
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        awaited = swarm(crew)
        beating(crew, "agent", "netem", number=2)
        while not all(child.doing for child in crew.children):
            crew.listen()
        with pytest.raises(RunFailed, match=r"^nothing moved for .* nobody is to blame: .*agent 2 waits for netem"):
            blamed(crew, awaited)


def test_time_in_which_the_launcher_did_not_look_is_nobodys_silence(tmp_path):
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        awaited = swarm(crew)
        crew.start("agent", ["sleep", "600"], {}, 2)
        while not all(child.doing for child in crew.children[:3]):
            crew.listen()
        began = crew.now_s
        for _ in range(2):  # as if it had been stopped: everything is late, and the beats are there
            time.sleep(1.25 * SHORT)
            crew.listen()
            crew.blame_the_silent(awaited)
        assert crew.now_s - began < SHORT


def test_a_process_stopped_before_it_is_ready_is_named(tmp_path):
    with ProcessGroup(tmp_path, 0.6, Interruption()) as crew:
        child = crew.start("agent", ["sleep", "600"], {}, 2)
        os.kill(child.process.pid, signal.SIGSTOP)
        with pytest.raises(RunFailed, match=r"^agent 2 \(pid \d+\) is stopped \(state T\), and not ready: waited "):
            crew.await_ready([child])


def test_who_does_not_leave_is_named(tmp_path):
    with ProcessGroup(tmp_path, 0.6, Interruption()) as crew:
        crew.start("agent", ["sleep", "600"], {}, 2)
        crew.release()
        with pytest.raises(
            RunFailed, match=r"^agent 2 \(pid \d+\) sleeps \(state S\), and had not left .* s after the end"
        ):
            crew.await_all_gone()


def test_what_a_silent_program_said_last_is_told(tmp_path):
    """Before: who looked for the reason had to know that there is a log."""
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        awaited = swarm(crew)
        crew.start("agent", ["sh", "-c", "echo no port /dev/ttyUSB0 >&2; exec sleep 600"], {}, 2)
        with pytest.raises(RunFailed, match=r"\n  agent 2 said last:\n    no port /dev/ttyUSB0$"):
            blamed(crew, awaited)
    with ProcessGroup(tmp_path, SHORT, Interruption()) as crew:
        crew.start("agent", ["sleep", "600"], {}, 3)
        with pytest.raises(RunFailed) as failure:
            blamed(crew, crew.children)
    assert "said last" not in str(failure.value)
