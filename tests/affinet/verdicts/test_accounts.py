"""Every message is accounted for; where accounts do not close, or somebody loses a message, the run fails and says so."""

import dataclasses
import json
import os
import stat
import sys
from pathlib import Path

import pytest
from flying import PROCESSES, TRIANGLE, plan_of
from paths import PROGRAMS

from affinet.cli import commands
from affinet.runtimes import launcher
from affinet.runtimes.inject import Access
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.runtimes.supervision import ProcessGroup
from affinet.verdicts import outcome
from affinet.verdicts.outcome import accounts_of
from netem.medium import journal
from netem.medium.medium import JOURNAL
from netem.wire.session import Login

OFFERED = 10 * 6 * 3  # ticks, links, channels

# All that accounts have to follow: delays, copies, losses, queues, a kill, a partition that holds what is under way.
WILD = (
    *("time.dt=0.05", "time.duration=4", "network.availability=0.8", 'network.profile="wild"'),
    'network.profiles.wild={like="wifi_busy",duplicate=0.05,rate={rate=3e5,queue=4000}}',
    'timeline=[{verb="partition",at=2.5,until=5,groups="leaders",in_flight="hold"},{verb="kill",at=2,agents=[6]},'
    '{verb="delay",at=1,until=3,links=["all"],delay=0.3}]',
)


# ---- booked by the medium, with its journal


@pytest.mark.parametrize(
    "overrides",
    [
        pytest.param(WILD, id="wild"),
        pytest.param(("time.dt=0.05", "time.duration=3", "network.delay_ticks=3"), id="under way at the end"),
    ],
)
def test_the_journal_has_the_accounts_of_the_run(overrides, out):
    plan = plan_of("corridor", *overrides)
    flown = fly(plan, "inprocess", out, lambda *_: None)
    done = rehearse(plan)
    booked = journal.told(out / JOURNAL).accounts
    assert booked == accounts_of(done.arrays, booked.in_flight)
    assert booked.close
    assert booked.in_flight == done.outcome.messages["in_flight"] == flown.messages["in_flight"] > 0


@PROCESSES
def test_the_journal_and_its_accounts_outlive_the_world(out, monkeypatch):
    """Before: the world wrote the journal, and what it had not written when it was killed was lost."""
    plan = plan_of("corridor", "time.dt=0.05", "time.duration=90", "network.availability=0.6")
    batch = plan.books(None).batch

    def kill_the_world(group, _awaited):
        world = group.children[0]
        if batch < world.doing.tick and batch // 5 < world.doing.tick % batch < batch // 2:
            world.process.kill()

    monkeypatch.setattr(ProcessGroup, "blame_the_silent", kill_the_world)
    out.mkdir()
    flight = launcher.Launcher(plan, out, watch=lambda *_: None).fly()
    assert flight.failure.startswith("world (pid ")
    table = journal.read(out / JOURNAL)
    booked = journal.told(out / JOURNAL).accounts
    assert booked.close
    assert booked.ticks == table["tick"].to_numpy().max() + 1
    assert booked.ticks % batch  # what was not a whole batch yet is there too
    failed = judged(plan, None, failure="the world was killed", accounts=booked, uninstructed=None)
    assert failed.reasons == ("the world was killed",)
    assert failed.messages["offered"] == booked.ledger.offered > 0
    assert failed.ticks == booked.ticks
    assert failed.digest is None


def judged(plan, arrays, *, accounts, failure=None, uninstructed=0):
    nothing = {"wall_s": 1.0, "processes": [], "out": Path()}
    facts = {"uninstructed": uninstructed, "failure": failure, "accounts": accounts, "user_code": False}
    return outcome.judge(plan, plan.timeline, arrays, **facts, **nothing)


# ---- where they do not close


def flown(*overrides):
    plan = plan_of("corridor", "time.dt=0.05", "time.duration=1", "network.delay_ticks=2", *overrides)
    done = rehearse(plan)
    return plan, done.arrays, accounts_of(done.arrays, done.outcome.messages["in_flight"])


@pytest.mark.parametrize(
    ("field", "by", "booked"),
    [
        pytest.param("delivered", 1, 1921, id="one more arrived than was under way"),
        pytest.param("delivered", -1, 1919, id="one is gone"),
        pytest.param("copies", 1, 1920, id="a copy that nobody made"),
    ],
)
def test_accounts_that_do_not_close_fail_the_run_and_say_so(field, by, booked):
    plan, arrays, accounts = flown()
    ledger = dataclasses.replace(accounts.ledger, **{field: getattr(accounts.ledger, field) + by})
    done = judged(plan, arrays, accounts=dataclasses.replace(accounts, ledger=ledger))
    doubled = int(field == "copies")
    assert done.verdict == "fail"
    assert done.reasons == (
        f"the accounts do not close: 1920 messages offered and {doubled} doubled, {booked} accounted for",
        "what the medium has booked and what the world was told do not agree",
    )


@pytest.mark.parametrize("name", ["late", "copies"])
def test_a_world_that_was_told_otherwise_than_the_medium_has_booked_fails_the_run(name):
    plan, arrays, accounts = flown()
    wrong = arrays[name].copy()
    wrong[5] += 1
    done = judged(plan, {**arrays, name: wrong}, accounts=accounts)
    assert done.reasons == ("what the medium has booked and what the world was told do not agree",)


def test_accounts_that_close_pass():
    plan, arrays, accounts = flown()
    assert judged(plan, arrays, accounts=accounts).verdict == "pass"


def test_what_was_lost_by_nobodys_order_fails_the_run_and_is_counted():
    plan, arrays, accounts = flown()
    done = judged(plan, arrays, accounts=accounts, uninstructed=3)
    assert done.verdict == "fail"
    assert done.reasons == ("3 messages were lost that nobody ordered",)
    assert dataclasses.asdict(done)["messages"]["uninstructed"] == 3


# ---- over processes, one of which goes wrong


def flies_with(monkeypatch, tmp_path, role, *program):
    scenario, out = tmp_path / "triangle.toml", tmp_path / "run"
    scenario.write_text(TRIANGLE)
    command, honest = [sys.executable, "-P", str(PROGRAMS / program[0]), *program[1:]], ProcessGroup.fork

    def fork(group, forked, brief, number=None, **trust):
        if forked != role:
            return honest(group, forked, brief, number, **trust)
        return group.start(role, command, brief, number)

    monkeypatch.setattr(ProcessGroup, "fork", fork)
    status = commands.main(["run", str(scenario), "--out", str(out), "--json"])
    return status, json.loads((out / "summary.json").read_text())


@PROCESSES
def test_a_message_that_an_agent_lost_fails_the_run(monkeypatch, tmp_path):
    status, summary = flies_with(monkeypatch, tmp_path, "agent", "wayward_agent.py", "loses")
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
            "where it may say ready, beat, failed, lost, user-code, done, as JSON (docs/protocol.md)",
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
    status, summary = flies_with(monkeypatch, tmp_path, "agent", "wayward_agent.py", wrong)
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
    out, private = tmp_path / "out", tmp_path / "private"
    out.mkdir()
    private.mkdir()
    with Access("r1", Login("tcp/x", "control", "secret")).granted(out, private):
        assert mode(out / "control.json") == 0o600
    assert not [*out.iterdir(), *private.iterdir()]


@pytest.mark.usefixtures("anything_goes")
def test_each_process_has_a_password_of_its_own_and_none_lies_on_a_disk(tmp_path):
    flying = launcher.Launcher(plan_of("corridor"), tmp_path, watch=lambda *_: None)
    logins = flying._make_logins(tmp_path)
    assert not list(tmp_path.iterdir())
    assert len({login.password for login in logins.values()}) == len(logins) == 7 + 5
