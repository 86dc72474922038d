"""Slow is not stalled, and who holds a swarm up is named: by tables, and with processes that only beat."""

import json
import os
import signal
import sys
import time

import pytest

from affinet.runtimes.child import RunFailed
from affinet.runtimes.interruption import Interruption
from affinet.runtimes.silence import ProcessStatus, StatusHistory, holding_up, stalled
from affinet.runtimes.supervision import ProcessGroup
from affinet.runtimes.told import Beat

PATIENCE = 3.0
AWAITED = ("world", "netem")


def beats(**said):
    everybody = dict.fromkeys(("world", "netem", "centre", "agent 1", "agent 2", "agent 3"))
    return everybody | {name.replace("_", " "): beat for name, beat in said.items()}


def waits(*whom):
    return Beat(7, "what it owes", whom)


WORKS = Beat(7, "", ())
INBOX = waits("netem")


@pytest.mark.parametrize(
    ("said", "who"),
    [
        pytest.param(
            beats(world=waits("agent 1", "agent 2"), netem=waits("agent 1"), agent_1=WORKS, agent_2=INBOX),
            ["agent 1"],
            id="an agent works",
        ),
        pytest.param(
            beats(world=waits("agent 1", "agent 2"), netem=waits("agent 1"), agent_2=INBOX),
            ["agent 1"],
            id="or is mute",
        ),
        pytest.param(
            beats(world=waits("agent 1", "agent 2", "agent 3"), netem=waits("agent 1"), agent_1=WORKS),
            ["agent 1"],
            id="no act is due of those who do not beat, while the medium collects",
        ),
        pytest.param(
            beats(world=waits("agent 1", "agent 3"), netem=waits("world"), agent_1=WORKS),
            ["agent 1", "agent 3"],
            id="when it has collected, acts are due",
        ),
        pytest.param(
            beats(world=waits("agent 1", "agent 2"), agent_1=INBOX, agent_2=INBOX), ["netem"], id="the medium is mute"
        ),
        pytest.param(beats(netem=waits("world"), agent_1=INBOX), ["world"], id="the world is mute"),
        pytest.param(
            beats(world=waits("agent 1"), netem=waits("world"), agent_1=waits("centre")),
            ["centre"],
            id="the centre is mute",
        ),
        pytest.param(
            beats(world=waits("agent 1"), netem=waits("agent 2"), agent_1=INBOX, agent_2=INBOX),
            [],
            id="a message is lost",
        ),
        pytest.param(beats(world=waits("launcher"), netem=waits("world")), [], id="an order is due"),
    ],
)
def test_those_are_looked_at_for_whom_everybody_waits_in_the_end(said, who):
    assert holding_up(said, AWAITED) == who


def looks(first, before, now):
    return StatusHistory(ProcessStatus(*first), ProcessStatus(*before), ProcessStatus(*now))


@pytest.mark.parametrize(
    ("seen", "agents", "ours"),
    [
        pytest.param(looks(("stopped", 1.0), ("stopped", 1.0), ("stopped", 1.0)), True, True, id="stopped"),
        pytest.param(
            looks(("running", 1.0), ("running", 1.0), ("tracing-stop", 1.9)), True, True, id="held by a debugger"
        ),
        pytest.param(looks(("sleeping", 1.0), ("sleeping", 1.0), ("sleeping", 1.01)), True, True, id="asleep"),
        pytest.param(
            looks(("running", 1.0), ("running", 1.0), ("running", 1.0)), False, False, id="wants the processor"
        ),
        pytest.param(
            looks(("disk-sleep", 1.0), ("disk-sleep", 1.0), ("disk-sleep", 1.0)), False, False, id="wants a disk"
        ),
        pytest.param(looks(("running", 1.0), ("running", 3.0), ("running", 3.9)), False, False, id="computes"),
        pytest.param(
            looks(("sleeping", 1.0), ("sleeping", 1.5), ("sleeping", 2.0)), False, False, id="its threads compute"
        ),
        pytest.param(
            looks(("running", 1.0), ("running", 3.5), ("running", 4.0)), True, False, id="computes for too long"
        ),
    ],
)
def test_only_who_does_nothing_is_stalled_and_code_of_the_user_that_never_ends(seen, agents, ours):
    assert seen.stalled(PATIENCE, trusted=False) is agents
    assert seen.stalled(PATIENCE, trusted=True) is ours


def test_nobody_is_to_blame_while_one_works_but_who_is_stopped_always_is():
    asleep = looks(*[("sleeping", 1.0)] * 3)
    works, stopped = looks(*[("running", 1.0)] * 3), looks(*[("stopped", 1.0)] * 3)
    assert stalled({"agent 1": asleep, "agent 2": works}, PATIENCE, ()) == []
    assert stalled({"agent 1": asleep, "agent 2": works, "agent 3": stopped}, PATIENCE, ()) == ["agent 3"]
    assert stalled({"agent 1": asleep, "agent 3": asleep}, PATIENCE, ()) == ["agent 1", "agent 3"]


# ---- processes that only beat

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
        medium = crew.start("netem", computes, {}, trusted=True)
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
