"""Each row on flights over processes and in real time is not ok where something is not what was asked for, and says which."""

import flown
import numpy as np
import pytest
from against import Against
from carried import asked, processes, real, swarm
from carried.processes import CASES, DT
from carried.real import Delays, Machine
from flying import PROCESSES

from netem.medium.medium import Medium
from netem.medium.verdict import Verdict

AGAINST = Against("planted", "")
CLOCK = (f"time.dt={DT}", "time.duration=10")


def not_ok(rows):
    return {row.what for row in rows if not row.ok}


# ---- what agents hear, against the journal

HEARD = {"heard other than the journal says"}


@pytest.fixture(scope="module")
def over():
    """A flight over processes, whose agents note what they hear; of everything that may happen to a message."""
    return swarm.over_processes(CASES[0].text, 1, CLOCK)


@pytest.fixture(scope="module")
def alone():
    return swarm.in_process(CASES[0].text, 1, CLOCK)


def hearing(over, change):
    """The flight, had agents heard what is made here of the messages that arrived."""
    arrived = over.noted.arrived[np.lexsort(over.noted.arrived.T[::-1])]
    return over._replace(noted=over.noted._replace(arrived=change(arrived)))


def swapped(arrived):
    """Two messages of one link, one tick after the other."""
    changed, (tick, _, channel, link, _) = arrived.copy(), arrived.T
    one = np.flatnonzero((tick == 100) & (channel == 1))[0]
    other = np.flatnonzero((tick > 100) & (channel == 1) & (link == link[one]))[0]
    changed[[one, other], 1] = arrived[[other, one], 1]
    return changed


def added(column):
    def change(arrived):
        changed = arrived.copy()
        changed[500, column] += 1
        return changed

    return change


MISHEARD = {
    "nothing": (lambda arrived: arrived, set()),
    "one is lost": (lambda arrived: np.delete(arrived, 500, axis=0), {"messages heard"} | HEARD),
    "one comes twice": (lambda arrived: np.insert(arrived, 500, arrived[500], axis=0), {"messages heard"} | HEARD),
    "one is a tick late": (added(0), HEARD),
    "one speaks of another tick": (added(1), HEARD),
    "one is of another link": (added(3), HEARD),
    "one is not what was said": (lambda arrived: np.vstack([arrived[:-1], arrived[-1] ^ [0, 0, 0, 0, 1]]), HEARD),
    "two are swapped": (swapped, HEARD),
}
CERTAIN = {"messages heard", *HEARD, "newest other than heard", "journal and digest are those in one process"}


@PROCESSES
@pytest.mark.parametrize("name", MISHEARD)
def test_one_message_that_agents_hear_otherwise_is_found(over, alone, name):
    change, found = MISHEARD[name]
    said = not_ok(processes.of_a_flight(CASES[0], hearing(over, change), alone)) & CERTAIN
    assert said - {"newest other than heard"} == found


@PROCESSES
def test_newest_messages_are_those_that_were_heard(over, alone):
    newest = over.newest.copy()
    newest[50, 1, 3] += 1
    assert not_ok(processes.of_a_flight(CASES[0], over._replace(newest=newest), alone)) & CERTAIN == {
        "newest other than heard"
    }


@PROCESSES
def test_a_journal_that_one_process_does_not_have_is_found(over):
    other = swarm.in_process(CASES[0].text, 2, CLOCK)
    assert "journal and digest are those in one process" in not_ok(processes.of_a_flight(CASES[0], over, other))


# ---- the journal, against what was asked

TICKS = 10_000


def judged(case, folder, *changes):
    """The verdicts under the profile of a case, whose text is changed."""
    text = case.text
    for was, becomes in changes:
        assert was in text
        text = text.replace(was, becomes)
    plan = swarm.planned(text, 1, folder, [f"time.dt={DT}", f"time.duration={TICKS * DT}"])
    return flown.fly(Medium(plan.world.seed, plan.channels, plan.profiles, plan.timeline), TICKS)


OTHERS = {
    "nothing": (0, (), set()),
    "nothing of two layers": (1, (), set()),
    "nothing of a queue": (2, (), set()),
    "losses, a little": (0, (("p = 0.0625", "p = 0.07"),), {"mean loss"}),
    "bursts, and no more is lost": (
        0,
        (("p = 0.0625, r = 0.25", "p = 0.05, r = 0.2"),),
        {"burst lengths", "mean burst"},
    ),
    "a layer": (1, (('{ model = "bernoulli", p = 0.5 }, ', ""),), {"mean loss", "burst lengths", "mean burst"}),
    "delays, by a tick": (1, (("mean = 0.075", "mean = 0.125"),), {"delay, ticks", "delay on each link, ticks"}),
    "delays, by 5 %": (0, (("mean = 0.1", "mean = 0.105"),), {"delay, ticks", "delay on each link, ticks"}),
    "copies": (0, (("duplicate = 0.1", "duplicate = 0.11"),), {"copies", "copies on each link"}),
    "what is stale": (0, (('"stale", p = 0.05', '"stale", p = 0.06'),), {"stale messages"}),
    "what is wrong": (0, (('"bias", p = 0.05', '"bias", p = 0.06'),), {"bias messages"}),
    "a rate, by 1 %": (2, (("rate = 12000", "rate = 11880"),), {"due in other ticks", "of so many that waited"}),
    "a queue, by a message": (2, (("queue = 300", "queue = 348"),), {"verdicts other than computed again"}),
}


@pytest.mark.parametrize("name", OTHERS)
def test_a_journal_of_another_air_than_was_asked_for_is_found(name, tmp_path):
    number, changes, found = OTHERS[name]
    case = CASES[number]
    said = not_ok(asked.rows(AGAINST, case, judged(case, tmp_path, *changes), DT))
    assert found <= said
    assert changes or not said


def one_link_loses_more(made):
    kind = made.kind.copy()
    kind[::12, :, 3] = Verdict.LOST
    return made._replace(kind=kind)


def two_links_lose_alike(made):
    kind = made.kind.copy()
    kind[..., 3] = kind[..., 2]
    return made._replace(kind=kind)


def all_links_lose_a_little_alike(made):
    """One tick of ten all of them lose what the first does."""
    kind = made.kind.copy()
    kind[::10] = kind[::10, :1, :1]
    return made._replace(kind=kind)


def waiting(made, draw):
    """Messages wait as others do, of which `draw` says which, of waits (T, C, L)."""
    tick = np.arange(len(made.due))[:, None, None]
    return made._replace(kind=np.full_like(made.kind, Verdict.DELAYED), due=tick + draw(np.maximum(made.due - tick, 1)))


def one_in_ten_as_the_one_before(wait):
    drawn = wait.copy()
    drawn[1::10] = drawn[:-1:10]
    return drawn


def two_links_wait_alike(wait):
    drawn = wait.copy()
    drawn[..., 3] = drawn[..., 2]
    return drawn


DEPENDENT = {
    "a link that loses more": (one_link_loses_more, "loss on each link"),
    "two links of the same losses": (two_links_lose_alike, "losses of every two links and channels"),
    "links of some of the same losses": (all_links_lose_a_little_alike, "their correlation in the mean"),
    "delays as the ones before": (
        lambda made: waiting(made, one_in_ten_as_the_one_before),
        "delays of a message and the next",
    ),
    "two links of the same delays": (lambda made: waiting(made, two_links_wait_alike), "delays of a link and the next"),
}


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    return judged(CASES[0], tmp_path_factory.mktemp("honest"))


@pytest.mark.parametrize("name", DEPENDENT)
def test_draws_that_depend_on_each_other_are_found(name, honest):
    planted, found = DEPENDENT[name]
    assert found in not_ok(asked.rows(AGAINST, CASES[0], planted(honest), DT))


def test_the_variance_of_a_share_of_a_chain_is_that_of_many_chains(honest):
    lost = honest.kind == Verdict.LOST
    parts = lost[: TICKS // 100 * 100].reshape(-1, 100, lost.shape[1] * lost.shape[2]).mean(axis=1)
    assert parts.var() == pytest.approx(asked.mean_variance(CASES[0].chain, 100), rel=0.05)


# ---- delays in real time

QUIET = Machine(1.0, 1.0, "load 0 of 2")


def delays():
    rng = np.random.default_rng(1)
    due = rng.uniform(0.0, 0.2, 5000)
    return Delays(due, due + rng.exponential(0.001, 5000))


def early(said):
    return said._replace(taken_s=np.where(np.arange(5000) == 7, said.asked_s - 1e-4, said.taken_s))


def of_nobody(said):
    return said._replace(asked_s=np.where(np.arange(5000) == 7, np.nan, said.asked_s))


MISTIMED = {
    "nothing": (lambda said: said, set()),
    "one early": (early, {"heard before they were due"}),
    "one that was not delivered": (of_nobody, {"heard and not delivered"}),
    "longer by 1 %": (lambda said: said._replace(taken_s=1.01 * said.taken_s), {"taken by asked"}),
    "later by a tick": (lambda said: said._replace(taken_s=said.taken_s + real.DT), {"later than asked, p50, ms"}),
}


@pytest.mark.parametrize("name", MISTIMED)
def test_delays_that_took_other_than_asked_are_found(name):
    planted, found = MISTIMED[name]
    assert not_ok(real.delay_rows(AGAINST, planted(delays()), QUIET)) == found


def test_what_a_machine_is_late_by_is_no_fault_of_the_air():
    late = delays()
    late = late._replace(taken_s=late.taken_s + 0.03)
    assert not_ok(real.delay_rows(AGAINST, late, QUIET))
    assert not not_ok(real.delay_rows(AGAINST, late, Machine(20.0, 1.0, "load 9 of 2")))


def test_a_slope_is_as_sure_as_delays_scatter():
    said, scattered = delays(), delays()
    scattered = scattered._replace(taken_s=scattered.asked_s + 30.0 * (scattered.taken_s - scattered.asked_s))
    assert 20.0 * width(said) < width(scattered) < 40.0 * width(said)


def width(said):
    (row,) = (row for row in real.delay_rows(AGAINST, said, QUIET) if row.what == "taken by asked")
    low, high = map(float, row.interval.split(" to "))
    return high - low


def test_delays_that_were_asked_of_the_medium_are_those_of_the_profile():
    due = delays().asked_s
    assert not not_ok(real.asked_rows(AGAINST, due, due))
    other = np.where(np.arange(len(due)) == 7, due + 1e-3, due)
    assert not_ok(real.asked_rows(AGAINST, other, due)) == {"asked other than the profile draws"}
    assert not_ok(real.asked_rows(AGAINST, 0.95 * due, 0.95 * due)) == {"asked, s"}


def test_losses_in_real_time_are_those_of_lockstep():
    clock = (f"time.dt={real.DT}", "time.duration=5")
    one, other = (swarm.in_process(real.CASE.text, seed, clock) for seed in (1, 2))
    assert not not_ok(real.verdict_rows(AGAINST, one, one))
    assert "lost other than in lockstep" in not_ok(real.verdict_rows(AGAINST, one, other))
