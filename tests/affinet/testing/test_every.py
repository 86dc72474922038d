"""All faults of a class, flown: the certificate that nothing breaks, and what it takes to get none."""

import json
from itertools import product

import pytest
from flying import PROCESSES

from affinet.cli import commands, quarry
from affinet.planning import making
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.testing import certificate, every, flights
from affinet.testing.hunt import Quarry
from affinet.verdicts import checkers
from affinet.verdicts.checking import Checker, CheckResult

pytestmark = PROCESSES

SECOND = loading.load("corridor", ("time.dt=0.05", "time.duration=1", "network.availability=1.0"))
HUNT = ("hunt", "corridor", "--set", "time.dt=0.05", "--duration", "1", "--estimator", "rkf")


def spans(given, most, step):
    """Beginnings and ends in ticks, of lengths in ticks up to the longest: what a class is, said another way."""
    moments = range(0, given.time.ticks + 1, step)
    return {(start, end) for start, end in product(moments, moments) if 0 < end - start <= most}


def flown(text, *invariants, given=SECOND, seeds=(1,)):
    those, hunted = every.parse(text), Quarry(lambda: invariants, {(): given}, seeds, ["cut"])
    trials = [*those.trials(hunted.scenarios, hunted.seeds)]
    found = certificate.fly_every(hunted, trials, flights.in_this_process, lambda _: None)
    return found, certificate.certificate(those, hunted, found)


def watching(breaks=lambda _: False):
    """An invariant that writes down every fault it sees, and fails where one is as said."""
    seen = []

    def check(evidence):
        those = [
            (fault.start, fault.end, frozenset(fault.pairs), frozenset(fault.agents)) for fault in evidence.plan.faults
        ]
        seen.extend(those)
        broken = any(map(breaks, those))
        return CheckResult("watching", "fail" if broken else "pass", 0 if broken else None, f"{len(those)} faults")

    return Checker("watching", check), seen


def ways(given):
    links = making.make(given).world.links
    return [*zip(links.src.tolist(), links.dst.tolist(), strict=True)]


def test_every_fault_of_a_class_is_flown_and_none_twice():
    invariant, seen = watching()
    found, _ = flown("one link, up to 0.3 s, from any 0.15 s, with cut", invariant)
    expected = {
        (start, end, frozenset([pair]), frozenset())
        for (start, end), pair in product(spans(SECOND, 6, 3), ways(SECOND))
    }
    assert len(seen) == len(set(seen)) == found.flown == len(expected)
    assert set(seen) == expected


def test_every_pair_of_edges_and_every_agent_is_one_of_its_class():
    invariant, seen = watching()
    flown("two edges, up to 0.5 s, from any 0.5 s", invariant)
    both = {frozenset([(i, j), (j, i)]) for i, j in ways(SECOND)}
    pairs = {one | other for one in both for other in both if one != other}
    assert {pair for _, _, pair, _ in seen} == pairs
    assert len(seen) == 2 * len(pairs)
    invariant, seen = watching()
    flown("one agent, up to 0.5 s, from any 0.5 s, with pause", invariant)
    assert sorted((start, end, *agents) for start, end, _, agents in seen) == [
        (start, start + 10, agent) for start in (0, 10) for agent in range(1, 8)
    ]


CORNERS = [(0, 3, (1, 2)), (0, 6, (1, 2)), (15, 18, (7, 6)), (12, 18, (7, 6)), (6, 12, (3, 5))]


def only(start, end, pair):
    """An invariant that one fault alone breaks."""
    return watching(lambda fault: fault == (start, end, frozenset([pair]), frozenset()))[0]


def test_the_one_fault_of_a_class_that_breaks_something_is_found():
    found, _ = flown("one link, up to 0.3 s, from any 0.15 s", *(only(*corner) for corner in CORNERS))
    assert not found.certain
    for number, (start, end, pair) in enumerate(CORNERS):
        ((trial, finding, _),) = found.broken[number]
        ((entry,),) = trial.faults
        assert (entry["at"], entry["lasts"]) == (round(0.05 * start, 9), round(0.05 * (end - start), 9))
        assert entry["links"] == ["{}->{}".format(*pair)]
        assert finding.verdict == "fail"


def test_each_seed_and_setting_has_all_faults():
    invariant, seen = watching()
    found, says = flown("one agent, up to 0.5 s, from any 0.5 s", invariant, seeds=(3, 5))
    assert found.flown == 2 * 2 * 7
    assert says["seeds"] == [3, 5]
    assert "other seeds than 3, 5: other noise and losses" in says["does_not_cover"]
    assert len(seen) == found.flown


def test_there_is_no_certificate_of_what_was_never_put_to_the_test():
    found, _ = flown("one link, up to 0.5 s, from any 0.5 s", checkers.converged(1e-9, by=4.0))
    assert not found.certain
    assert found.untold == found.flown


def test_a_class_for_which_an_invariant_fails_undisturbed_is_not_flown():
    with pytest.raises(ScenarioError, match="it fails with no fault at all"):
        flown("one link, up to 0.5 s, from any 0.5 s", checkers.bounded(1e-9))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("all links", "not understood; write it like 'one link, up to 5 s, from any 0.5 s, with cut'"),
        ("three links, up to 5 s, from any 0.5 s", "three: there are one, two"),
        ("one lnk, up to 5 s, from any 0.5 s", "lnk: did you mean 'link'?"),
        ("one link, up to 5 s, from any 0.5 s, with kill", "with kill: of links there are cut"),
        ("one agent, up to 5 s, from any 0.5 s, with pouse", "with pouse: of agents did you mean 'pause'?"),
        ("one link, up to 0.5 s, from any 0.07 s", "from any 0.07 s: give a multiple of the tick, time.dt, 0.05 s"),
        ("one link, up to 0.5 s, from any 0.2 s", "up to 0.5 s: give a multiple of what it begins at, 0.2 s"),
        ("one link, up to 0 s, from any 0.2 s", "up to 0 s: give a multiple"),
        ("one link, up to 5 s, from any 0.5 s", "up to 5 s: the run is over after 1 s"),
    ],
)
def test_what_is_no_class_is_refused_with_the_word(text, says):
    with pytest.raises(ScenarioError) as raised:
        [*every.parse(text).trials({(): SECOND}, (1,))]
    assert says in str(raised.value)


def test_a_class_says_what_was_parsed():
    text = "two links, up to 5 s, from any 0.5 s, with lose"
    assert str(every.parse(text)) == text
    assert str(every.parse("one agent,  up to 5.0 s, from any 0.50 s")) == (
        "one agent, up to 5 s, from any 0.5 s, with kill"
    )


def test_processes_leave_nothing_out(monkeypatch):
    monkeypatch.setattr(quarry, "_WORTH_PROCESSES", 0)
    those, hunted = every.parse("one link, up to 0.5 s, from any 0.25 s"), _quarry()
    trials = [*those.trials(hunted.scenarios, hunted.seeds)]
    monkeypatch.setattr(certificate, "AT_ONCE", 64)
    here = certificate.fly_every(hunted, trials, flights.in_this_process, lambda _: None)
    apart = certificate.fly_every(hunted, trials, quarry.flown_by(2), lambda _: None)
    assert here == apart
    assert here.flown == len(trials) > 2 * 64


def _quarry():
    return Quarry(flights.said(["bounded(5)"]), {(): SECOND}, [1], ["cut"])


def test_a_certificate_is_written_where_nothing_breaks(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ("--invariant", "bounded(5)", "--every", "one link, up to 0.5 s, from any 0.5 s", "--json")
    assert commands.main([*HUNT, *options]) == 0
    said = capsys.readouterr()
    (file,) = tmp_path.iterdir()
    says = json.loads(file.read_text())
    assert file.name == "certified-corridor.json"
    assert (says["flown"], says["held"], says["seeds"]) == (48, 48, [1])
    assert says["certificate"] in said.out
    assert all(f"not covered: {line}" in said.out for line in says["does_not_cover"])
    assert json.loads(said.out.splitlines()[-1])["certificate"] == "certified-corridor.json"
    (tmp_path / "again.toml").write_text(says["scenarios"][0])
    assert loading.load(str(tmp_path / "again.toml")).agents.estimator == "rkf"
    assert commands.main([*HUNT, *options, "--certificate", "certified-corridor.json"]) == 2
    assert "name another file with --certificate" in capsys.readouterr().err


def test_the_shortest_that_breaks_it_is_left_and_confirmed_and_there_is_no_certificate(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ("--invariant", "bounded(2)", "--every", "one link, up to 2 s, from any 1 s, with dropout", "--json")
    assert commands.main([*HUNT, *options, "--duration", "3"]) == 1
    said = capsys.readouterr().out
    assert not list(tmp_path.glob("certified*"))
    (entry,) = loading.load(str(tmp_path / "hunted-corridor.toml")).timeline
    assert "over processes, the same bits: bounded(2): fail" in said
    assert "break bounded(2)" in said
    found = json.loads(said.splitlines()[-1])
    assert found["certificate"] is None
    broken = found["broken"]["bounded(2)"]
    lengths = [one["fault"][0]["lasts"] for one in broken]
    assert lengths == sorted(lengths)
    assert entry.lasts == lengths[0]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ("--every", "one link, up to 0.5 s, from any 0.5 s", "--verbs", "cut"),
            "--every and --verbs: nothing is drawn",
        ),
        (
            ("--every", "one link, up to 0.5 s, from any 0.5 s", "--budget", "9"),
            "--every and --budget: nothing is drawn",
        ),
        (("--certificate", "c.json"), "--certificate: one is left of all faults of a class; say of which with --every"),
    ],
)
def test_what_goes_with_no_class_or_without_one_is_refused(options, says, capsys):
    assert commands.main([*HUNT, "--invariant", "bounded(5)", *options]) == 2
    assert says in capsys.readouterr().err
