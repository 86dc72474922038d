"""Every message is accounted for; where accounts do not close, or somebody loses a message, the run fails and says so."""

import dataclasses
import json
import os
import stat
import sys
from pathlib import Path

import pytest
from flying import PROCESSES, TRIANGLE, plan_of

from affinet.cli import commands
from affinet.runtimes import launcher
from affinet.runtimes.inject import Access
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.run import fly, rehearse
from affinet.verdicts import accounts, outcome
from netem.medium import journal
from netem.medium.verdict import Ledger
from netem.wire.session import Login

PROGRAMS = Path(__file__).parent / "programs"
OFFERED = 10 * 6 * 3  # ticks, links, channels

# All that accounts have to follow: delays, copies, losses, queues, a kill, a partition that holds what is under way.
WILD = (
    *("time.dt=0.05", "time.duration=4", "network.availability=0.8", 'network.profile="wild"'),
    'network.profiles.wild={like="wifi_busy",duplicate=0.05,rate={rate=3e5,queue=4000}}',
    'timeline=[{verb="partition",at=2.5,until=5,groups="leaders",in_flight="hold"},{verb="kill",at=2,agents=[6]},'
    '{verb="delay",at=1,until=3,links=["all"],delay=0.3}]',
)


# ---- from the journal, where that is all there is


@pytest.mark.parametrize(
    "overrides",
    [
        pytest.param(WILD, id="wild"),
        pytest.param(("time.dt=0.05", "time.duration=3", "network.delay_ticks=3"), id="under way at the end"),
    ],
)
def test_the_journal_has_the_accounts_of_the_run(overrides, out):
    plan = plan_of("corridor", *overrides)
    fly(plan, "inprocess", out, lambda *_: None)
    done = rehearse(plan)
    ledger = Ledger.of(*(done.arrays[name] for name in ("fates", "copies", "late", "dropped")))
    told = accounts.of_journal(plan, plan.timeline, out / journal.FILE)
    assert told == accounts.Accounts(plan.world.ticks, ledger, done.outcome.messages["in_flight"])
    assert told.in_flight == ledger.outstanding > 0


def test_the_journal_has_the_accounts_of_what_was_injected_too(out):
    """Without arrays, the outcome of a failed run is counted from the journal."""
    plan = plan_of("corridor", "time.dt=0.05", "time.duration=3", "network.availability=0.6")
    done = fly(plan, "inprocess", out, lambda *_: None)
    told = accounts.of_journal(plan, plan.timeline, out / journal.FILE)
    failed = judged(plan, None, failure="the world was killed", accounts=told)
    assert failed.verdict == "fail"
    assert failed.reasons == ("the world was killed",)
    assert failed.messages == {**done.messages, "uninstructed": None}
    assert failed.ticks == 60
    assert failed.digest is None


def judged(plan, arrays, *, failure=None, accounts=None, in_flight=None, uninstructed=None):
    nothing = {"wall_s": 1.0, "processes": [], "out": Path()}
    facts = {
        "in_flight": in_flight,
        "uninstructed": uninstructed,
        "failure": failure,
        "accounts": accounts,
        "user_code": False,
    }
    return outcome.judge(plan, plan.timeline, arrays, **facts, **nothing)


# ---- where they do not close


def flown(*overrides):
    plan = plan_of("corridor", "time.dt=0.05", "time.duration=1", "network.delay_ticks=2", *overrides)
    swarm, done = InProcessSwarm(plan), rehearse(plan)
    return plan, done.arrays, done.outcome.messages["in_flight"], swarm


@pytest.mark.parametrize(
    ("name", "by", "booked"),
    [
        pytest.param("late", 1, 1921, id="one more arrived than was under way"),
        pytest.param("late", -1, 1919, id="one is gone"),
        pytest.param("copies", 1, 1920, id="a copy that nobody made"),
    ],
)
def test_accounts_that_do_not_close_fail_the_run_and_say_so(name, by, booked):
    plan, arrays, in_flight, _ = flown()
    wrong = arrays[name].copy()
    wrong[5] += by
    done = judged(plan, {**arrays, name: wrong}, in_flight=in_flight, uninstructed=0)
    doubled = int(name == "copies")
    assert done.verdict == "fail"
    assert done.reasons == (
        f"the accounts do not close: 1920 messages offered and {doubled} doubled, {booked} accounted for",
    )


def test_accounts_that_close_pass():
    plan, arrays, in_flight, _ = flown()
    assert judged(plan, arrays, in_flight=in_flight, uninstructed=0).verdict == "pass"


def test_what_was_lost_by_nobodys_order_fails_the_run_and_is_counted():
    plan, arrays, in_flight, _ = flown()
    done = judged(plan, arrays, in_flight=in_flight, uninstructed=3)
    assert done.verdict == "fail"
    assert done.reasons == ("3 messages were lost that nobody ordered",)
    assert dataclasses.asdict(done)["messages"]["uninstructed"] == 3


# ---- over processes, one of which goes wrong


def flies_with(monkeypatch, tmp_path, package, *program):
    scenario, out = tmp_path / "triangle.toml", tmp_path / "run"
    scenario.write_text(TRIANGLE)
    honest = launcher.module
    command = [sys.executable, "-P", str(PROGRAMS / program[0]), *program[1:]]
    monkeypatch.setattr(launcher, "module", lambda name: command if name == package else honest(name))
    status = commands.main(["run", str(scenario), "--out", str(out), "--json"])
    return status, json.loads((out / "summary.json").read_text())


@PROCESSES
def test_a_message_that_an_agent_lost_fails_the_run(monkeypatch, tmp_path):
    status, summary = flies_with(monkeypatch, tmp_path, "agents", "wayward_agent.py", "loses")
    assert status == 1
    assert summary["verdict"] == "fail"
    assert summary["reasons"] == ["1 messages were lost that nobody ordered"]
    assert summary["messages"]["uninstructed"] == 1
    assert summary["messages"]["offered"] == summary["messages"]["delivered"] == OFFERED


@PROCESSES
def test_a_medium_whose_accounts_do_not_close_fails_the_run(monkeypatch, tmp_path):
    status, summary = flies_with(monkeypatch, tmp_path, "netem", "wayward_medium.py")
    assert status == 1
    assert summary["verdict"] == "fail"
    closing = f"{OFFERED} messages offered and 0 doubled, {OFFERED + 1} accounted for"
    assert summary["reasons"] == [f"the accounts do not close: {closing}"]


@PROCESSES
@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        pytest.param(
            "skips",
            "world: UninstructedLoss: agent 2 act: message 5 came where 4 was due; "
            "the transport lost or doubled 1 that nobody ordered",
            id="a number is skipped",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "prints",
            """agent 2 (pid {pid}): it said '{{"event":"kill","agents":[1]}}' on its standard output, """
            "where it may say ready, beat, failed, user-code, done, as JSON (docs/protocol.md)",
            id="an order that is the world's",
        ),
        pytest.param(
            "leaves",
            "agent 2 (pid {pid}) was ended with exit status 1. Its last lines:\n    it did not want to leave",
            id="an error at the end",
        ),
    ],
)
def test_an_agent_that_goes_wrong_fails_the_run_and_is_named(wrong, reason, monkeypatch, tmp_path):
    status, summary = flies_with(monkeypatch, tmp_path, "agents", "wayward_agent.py", wrong)
    (pid,) = (process["pid"] for process in summary["processes"] if process["id"] == 2)
    assert status == 1
    assert summary["verdict"] == "fail"
    assert summary["reasons"] == [reason.format(pid=pid)]


# ---- secrets


@pytest.fixture
def anything_goes():
    before = os.umask(0)
    yield
    os.umask(before)


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.usefixtures("anything_goes")
def test_nobody_else_reads_who_may_change_a_run(tmp_path):
    with Access("r1", Login("tcp/x", "control", "secret")).granted(tmp_path):
        assert mode(tmp_path / "control.json") == 0o600
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("anything_goes")
def test_nobody_else_reads_the_passwords(tmp_path):
    flying = launcher.Launcher(plan_of("corridor"), tmp_path, watch=lambda *_: None)
    logins = flying._make_logins(tmp_path)
    assert mode(tmp_path / "users") == 0o600
    assert len({login.password for login in logins.values()}) == len(logins) == 7 + 4
