"""Changing the air of a run while it flies, and flying it again."""

import threading

import pytest
from flying import PROCESSES, plan_of

from affinet.cli import commands, options
from affinet.planning import making as planning
from affinet.runtimes.inject import Access, InjectRequest, NotFlying
from affinet.runtimes.run import fly
from netem.core.links import Links
from netem.faults.control import Order, OrderAction, obey
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from netem.medium import journal
from netem.medium.medium import JOURNAL

pytestmark = PROCESSES

LINKS = Links.both_ways(3, [(1, 2), (2, 3)])
SCRIPTED = (Fault(Verb.CUT, 0, None, pairs=((1, 2),)),)


class Flight:
    """A run over processes in a thread, which tells when it is under way."""

    def __init__(self, plan, out):
        self._under_way = threading.Event()
        self._thread = threading.Thread(target=self._fly, args=(plan, out))

    def _fly(self, plan, out):
        self.outcome = fly(plan, "processes", out, lambda *_: self._under_way.set())
        self._under_way.set()

    def __enter__(self):
        self._thread.start()
        assert self._under_way.wait(60)
        return self

    def __exit__(self, *_):
        self._thread.join(100)


def test_what_is_injected_bites_lands_in_the_journal_and_is_flown_again(out, tmp_path):
    plan = plan_of("corridor", "time.duration=12", "record.enabled=false")
    with Flight(plan, out) as flight:
        access = Access.to(out)
        cut = access.ask(InjectRequest("cut", links=("1-2",), lasts_s=0.5).order(plan.scenario))
        lose = access.ask(InjectRequest("lose", links=("leaders->followers",), loss=0.5).order(plan.scenario))
        shown = access.ask(InjectRequest("show").order(plan.scenario))
        healed = access.ask(InjectRequest("heal").order(plan.scenario))
        refused = access.ask(Order(OrderAction.INJECT, Fault(Verb.KILL, 0, None, agents=(1,))))
    assert cut.holds == ("cut 2->1, 1->2",)
    assert "lose 0.5" in lose.holds[-1]
    assert shown.holds[-1] == lose.holds[-1]
    assert not healed.holds
    assert "can be injected" in refused.refused
    assert cut.k < lose.k < shown.k < healed.k

    faults = {fault["fault"].split()[0]: fault for fault in flight.outcome.to_json()["faults"]}
    assert all(fault.keys() == {"fault", "at", "touched", "what", "why"} for fault in faults.values())
    assert all((fault["touched"] > 0, fault["what"]) == (True, "messages") for fault in faults.values())
    assert {name: fault["at"] for name, fault in faults.items()} == pytest.approx(
        {"cut": cut.k * 0.01, "lose": lose.k * 0.01}
    )
    recorded = journal.told(out / JOURNAL).injected
    assert [(fault.verb, fault.start) for fault in recorded] == [(Verb.CUT, cut.k), (Verb.LOSE, lose.k)]
    assert recorded[1].end == healed.k

    for name, verdicts in (("models", False), ("journal", True)):
        again = fly(planning.again(out, (), verdicts=verdicts), "inprocess", tmp_path / name, lambda *_: None)
        assert again.digest == flight.outcome.digest
        tables = [journal.read(run / JOURNAL) for run in (out, tmp_path / name)]
        assert tables[0].drop_columns("event").equals(tables[1].drop_columns("event"))
        assert journal.told(tmp_path / name / JOURNAL).injected == recorded


def test_nobody_injects_into_a_run_that_does_not_fly(out, capsys):
    fly(plan_of("corridor", "time.duration=0.1"), "inprocess", out, lambda *_: None)
    with pytest.raises(NotFlying):
        Access.to(out)
    assert commands.main(["inject", str(out), "heal"]) == 2
    assert "no run flies" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["cut", "1-7"], "matches no link"),
        (["cut", "nobody"], "selects no links"),
        (["cut", "1-99"], "agent 99 does not exist"),
    ],
)
def test_bad_wishes_are_refused_before_they_are_sent(words, says, out, capsys):
    fly(plan_of("corridor", "time.duration=0.1"), "inprocess", out, lambda *_: None)
    assert commands.main(["inject", str(out), *words]) == 2
    assert says in capsys.readouterr().err


def test_the_word_all_selects_every_link():
    given = plan_of("corridor").scenario
    asked = InjectRequest("lose", links=("all",), loss=0.5).order(given)
    assert len(asked.fault.pairs) == 24
    typed = options.parser().parse_args(["inject", "RUN", "lose", "0.5", "--links", "all"])
    assert typed.links == ["all"]


def test_a_journal_of_other_agents_is_no_judge(out, tmp_path, capsys):
    fly(plan_of("corridor", "time.duration=0.2", 'agents.estimator="none"'), "inprocess", out, lambda *_: None)
    again = ["replay", "--verdicts", str(out), "--runtime", "inprocess", "--out", str(tmp_path / "again")]
    assert commands.main([*again, "--estimator", "ga-rkf"]) == 2
    assert "no verdicts on theta" in capsys.readouterr().err


def order(verb, **what):
    return Order(OrderAction.INJECT, Fault(verb, 0, what.pop("end", None), **what))


def test_healing_leaves_what_is_scripted():
    before, _ = obey(order(Verb.LOSE, pairs=((2, 3),), probability=0.4), 5, Timeline(LINKS, SCRIPTED))
    after, answer = obey(Order(OrderAction.HEAL, None), 9, before)
    assert after.scripted == tuple(SCRIPTED)
    assert after.injected == (Fault(Verb.LOSE, 5, 9, pairs=((2, 3),), probability=0.4),)
    assert answer.holds == ("cut 1->2",)


def test_healing_leaves_what_was_over_before():
    over, _ = obey(order(Verb.CUT, pairs=((1, 2),), end=2), 5, Timeline(LINKS, SCRIPTED))
    lasting, _ = obey(order(Verb.CUT, pairs=((2, 3),)), 6, over)
    healed, _ = obey(Order(OrderAction.HEAL, None), 9, lasting)
    assert [(fault.start, fault.end) for fault in healed.injected] == [(5, 7), (6, 9)]


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        (order(Verb.LOSE, pairs=((1, 2),), probability=1.5), "lies in [0, 1]"),
        (order(Verb.CUT, pairs=((1, 3),)), "not in the nominal graph"),
        (order(Verb.CUT, pairs=()), "no link"),
        (order(Verb.CUT, pairs=((1, 2),), end=0), "at least one tick"),
        (order(Verb.PARTITION, groups=((1,), (9,))), "does not exist"),
        (order(Verb.DEPART, agents=(1,)), "can be injected"),
        (Order(OrderAction.INJECT, None), "can be injected"),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(asked, why):
    before = Timeline(LINKS, SCRIPTED)
    after, answer = obey(asked, 3, before)
    assert why in answer.refused
    assert after is before
