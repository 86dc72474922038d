"""The relay, one piece for every runtime: what is said is kept while it may be heard, and what is decided ahead is no past."""

import ast

import numpy as np
import pytest
from airs import quiet_profile
from paths import ROOT

from netem.core.links import Links
from netem.faults.control import Order, OrderAction
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from netem.impairments.corrupt import Mark
from netem.medium.medium import Medium
from netem.medium.relay import Relay, changed_on_the_way
from netem.medium.verdict import Verdict

LINKS = Links.both_ways(3, [(1, 2), (2, 3)])
CHANNELS = ("sense", "input", "theta")


def relay(*faults, **impairments):
    return Relay[str](Medium(1, CHANNELS, [quiet_profile(LINKS, CHANNELS, **impairments)], Timeline(LINKS, faults)))


def flown(relayed, ticks):
    for tick in range(ticks):
        decided = relayed.decide(tick, None)
        relayed.keep(tick, f"said in {tick}")
        relayed.finish(tick)
    return decided


def test_only_the_relay_asks_the_medium():
    asked = {}
    for room in ("affinet", "agents", "world", "netem"):
        for path in (ROOT / room).rglob("*.py"):
            calls = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
            names = {call.attr for call in calls if isinstance(call, ast.Attribute)}
            asked[path.relative_to(ROOT).as_posix()] = names & {"judge", "deliver", "bit_draws"}
    assert {path for path, names in asked.items() if "deliver" in names} == {"netem/medium/relay.py"}
    assert "judge" in asked["netem/medium/relay.py"]


def test_what_nobody_can_hear_any_more_is_forgotten():
    relayed = relay(Fault(Verb.DELAY, 0, None, pairs=((1, 2),), seconds=0.02))
    flown(relayed, 10)
    assert relayed.in_flight
    assert relayed.said(9) == "said in 9"
    with pytest.raises(KeyError):
        relayed.said(0)


def test_what_is_decided_ahead_is_under_way_only_when_its_tick_is_over():
    relayed = relay(Fault(Verb.DELAY, 0, None, pairs=((1, 2),), seconds=0.5))
    flown(relayed, 1)
    before = relayed.in_flight
    relayed.decide(1, None)
    assert relayed.in_flight == before
    relayed.finish(1)
    assert relayed.in_flight > before


def test_who_is_idle_offers_nothing_but_its_sensors_sense():
    decided = flown(relay(Fault(Verb.PAUSE, 0, None, agents=(2,))), 1)
    kinds = decided.verdicts.kind
    from_2 = LINKS.src == 2
    assert (kinds[1:, from_2] == Verdict.SILENT).all()
    assert (kinds[0] != Verdict.SILENT).all()
    assert decided.awake.tolist() == [True, False, True]


def test_an_order_holds_from_the_next_decision_and_is_told_once():
    relayed = relay()
    assert flown(relayed, 1).injected is None
    cut = Fault(Verb.CUT, 0, None, pairs=((1, 2), (2, 1)))
    assert relayed.obey(Order(OrderAction.INJECT, cut), 1).holds
    decided = relayed.decide(1, None)
    relayed.finish(1)
    assert [fault.start for fault in decided.injected] == [1]
    assert (decided.verdicts.kind[:, LINKS.index[1, 2]] == Verdict.CUT).all()
    assert relayed.decide(2, None).injected is None


def test_only_liars_lie_and_only_about_maps():
    lie = Fault(Verb.LIE, 0, 5, agents=(2,), matrix=((2.0, 0.0), (0.0, 2.0)))
    relayed, who = relay(lie), np.array([1, 2, 3])
    fields = {"theta": np.broadcast_to(np.eye(2), (3, 2, 2)), "known": np.ones(3, dtype=bool)}
    assert [relayed.lies(0, "theta", agent) for agent in who.tolist()] == [False, True, False]
    assert not any(relayed.lies(5, "theta", agent) for agent in who.tolist())
    assert not any(relayed.lies(0, "input", agent) for agent in who.tolist())
    told = relayed.as_told(0, "theta", who, fields)
    assert told["theta"][:, 0, 0].tolist() == [1.0, 2.0, 1.0]
    assert told["known"].all()
    assert relayed.as_told(0, "input", who, fields)["theta"][1, 0, 0] == 1.0


def test_a_message_told_alone_is_told_as_among_others():
    relayed, draw = relay(), np.random.default_rng(1)
    fields = {"theta": draw.normal(size=(4, 2, 2)), "count": np.arange(4)}
    rows = [np.array([5, 6, 7, 8]), np.array([1, 2, 1, 2]), np.array([0, 1, 2, 3])]
    mark = np.array([Mark.BIT_FLIP, Mark.NAN, Mark.BIT_FLIP, Mark.BIAS], dtype=np.uint8)
    together = relayed.as_it_arrives(*rows, mark, fields)
    for n in range(4):
        one = {name: field[[n]] for name, field in fields.items()}
        alone = relayed.as_it_arrives(*(row[[n]] for row in rows), mark[[n]], one)
        assert alone["theta"].tobytes() == together["theta"][[n]].tobytes()
    assert (together["count"] == fields["count"]).all()
    assert np.isnan(together["theta"][1]).all()


def test_a_stale_message_was_said_and_is_not_changed():
    assert changed_on_the_way(np.array([Mark.NONE, Mark.STALE, Mark.NAN], dtype=np.uint8)).tolist() == [
        False,
        False,
        True,
    ]


def test_what_arrives_is_sorted_by_what_it_speaks_of_link_channel_and_mark():
    relayed = relay(Fault(Verb.DELAY, 0, 5, pairs=((1, 2),), seconds=0.02))
    arriving = flown(relayed, 4).arriving
    assert len({tuple(row) for row in arriving.tolist()}) == len(arriving)
    assert arriving.tolist() == sorted(arriving.tolist())
    assert arriving[0, 0] < 3 == arriving[-1, 0]
