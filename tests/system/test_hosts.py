"""Agents that a host carries fly as those do that have a process to themselves; a host is a process like any other."""

import os
import signal

import pytest
from flying import PROCESSES, digest_of, plan_of

from affinet.runtimes import launcher
from affinet.runtimes.machines import seats
from affinet.runtimes.run import fly

pytestmark = PROCESSES

SHORT = "time.duration=0.6"
BY_A_CENTRE = ('agents.estimator="crkf"', "agents.parameters.static.alpha=2", "network.availability=0.7")
FLOWN = {
    "a target": ("target", "time.dt=0.01", "time.duration=1.2", "agents.parameters.target.theta=2"),
    "a centre": ("rigid", SHORT, "time.dt=0.02", *BY_A_CENTRE),
    "double integrators": ("ravine", SHORT, "time.dt=0.02"),
    "late, and corrupted": (
        "corridor",
        SHORT,
        'network.profiles.odd={delay={model="uniform",mean=0.04,jitter=0.04},corrupt=[{kind="stale",p=0.1}],loss=[{model="bernoulli",p=0.2}]}',
        'network.profile="odd"',
    ),
}


@pytest.mark.parametrize("flown", FLOWN.values(), ids=FLOWN)
def test_the_bits_do_not_change(flown, out):
    outcome = fly(plan_of(*flown, "agents.per_process=4"), "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of(*flown)
    assert {process["role"] for process in outcome.processes} >= {"host"}


def test_so_many_go_together_and_who_is_left_over_flies_alone():
    plan = plan_of("corridor", "agents.per_process=3")
    assert seats.hosts_of(plan, programs=()) == {1: (1, 2, 3), 2: (4, 5, 6)}
    assert seats.hosts_of(plan, programs=(2, 3)) == {1: (1, 4, 5), 2: (6, 7)}
    assert seats.hosts_of(plan_of("corridor"), programs=()) == {}


def ended(out, number):
    """A run of which a host is sent a signal in its first tick."""
    sent = []

    def watch(*_):
        if not sent:
            sent.extend(child for child in flight.group if child.name == "host 2")
            os.kill(sent[0].process.pid, number)

    plan = plan_of("corridor", "time.duration=20", "time.patience=2", "record.enabled=false", "agents.per_process=3")
    flight = Watched(plan, out, watch)
    return flight.fly(), sent[0].process.pid


class Watched(launcher.Launcher):
    """A launcher whose processes can be looked at."""

    def __init__(self, plan, out, watch):
        super().__init__(plan, out, watch=watch)
        self.group = []

    def _fly(self, group, launched):
        self.group = group.children
        super()._fly(group, launched)


def test_a_host_that_is_killed_is_named(out):
    flown, pid = ended(out, signal.SIGKILL)
    assert f"host 2 (pid {pid}) was killed by SIGKILL" in flown.failure


def test_a_host_that_is_stopped_is_the_one_to_blame(out):
    flown, pid = ended(out, signal.SIGSTOP)
    assert f"host 2 (pid {pid}) is stopped (state T): nothing moved for " in flown.failure
    assert "waits for host 2" in flown.failure
