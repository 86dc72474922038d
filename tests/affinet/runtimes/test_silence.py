"""Slow is not stalled, and who holds a swarm up is named: by tables."""

import pytest

from affinet.runtimes.silence import ProcessStatus, StatusHistory, holding_up, stalled
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
