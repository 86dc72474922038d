"""The hunt for the smallest fault that breaks an invariant."""

import json
import re
import sys
import time

import pytest
from flying import PROCESSES, digest_of
from hypothesis import HealthCheck, given, settings
from scripted import timeline

from affinet.cli import commands, hunting
from affinet.planning import making as planning
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.testing import covered, flights, hunt, menu, strategies
from affinet.testing.covered import Item
from affinet.testing.flights import Case
from affinet.testing.hunt import Hunted, Quarry
from affinet.testing.trial import Deck, Trial
from affinet.verdicts import checkers
from affinet.verdicts.checking import Checker, CheckResult
from affinet.verdicts.evidence import Evidence

pytestmark = PROCESSES

CORRIDOR = loading.load("corridor", ("time.dt=0.05", "time.duration=4"))
BRIEF = ("--set", "time.dt=0.05", "--duration", "2", "--estimator", "rkf")


@pytest.fixture
def den(tmp_path, monkeypatch):
    """An empty directory to hunt from."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


def entries_of(given):
    return [entry.model_dump(mode="json", exclude_none=True) for entry in given.timeline]


def test_a_hunt_shrinks_writes_and_confirms_the_smallest_fault(den, capsys):
    options = ("--invariant", "bounded(5)", "--verbs", "cut,dropout", "--budget", "20", "--duration", "4")
    assert commands.main(["hunt", "corridor", *BRIEF, *options, "--out", "smallest.toml"]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    found = loading.load("smallest.toml")
    (entry,) = found.timeline
    assert "bounded(5): fail: at" in printed
    assert f"{entry.verb} " in printed
    assert "over processes, the same bits: bounded(5): fail: at" in printed
    assert "smallest.toml: affinet run smallest.toml" in printed
    assert found.agents.estimator == "rkf"
    assert (found.time.dt, found.time.duration) == (0.05, 4.0)
    (run,) = (den / "runs").iterdir()
    assert run.name.startswith("smallest-")
    assert (run / "summary.json").exists()


def test_the_smallest_is_named_after_its_scenario_where_no_file_is_named(den, monkeypatch):
    trial = Trial((), 1, ())
    smallest = hunt.Counterexample(0, CORRIDOR, CheckResult("bounded(5)", "fail", 3, "x"), "digest", trial)
    monkeypatch.setattr(hunt, "hunt", lambda *_, **__: Hunted([smallest]))
    monkeypatch.setattr(hunting, "confirm", lambda *_: None)
    assert commands.main(["hunt", "corridor", "--invariant", "bounded(5)"]) == 1
    assert said(loading.load(str(den / "hunted-corridor.toml"))) == said(CORRIDOR)


def test_a_hunt_that_finds_nothing_says_what_it_tried(capsys, den):
    options = ("--invariant", "bounded(1e9)", "--verbs", "delay,pause", "--budget", "4")
    assert commands.main(["hunt", "corridor", *BRIEF, *options]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "nothing found that breaks it" in printed
    assert "4 schedules, 0 could not tell" in printed
    assert any(verb in printed for verb in ("delay", "pause"))
    assert not list(den.iterdir())


@pytest.mark.usefixtures("den")
@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--invariant", "bounded(1e-9)"), "it fails with no fault at all"),
        (("--invariant", "bounded(5)", "--invariant", "bounded(1e-9)"), "it fails with no fault at all"),
        (("--invariant", "bound(5)"), "there are bounded(level)"),
        (("--invariant", "bounded(1e400)"), "level is inf: give a finite number above 0"),
        (("--invariant", "converged(1, by=-5)"), "by is -5: give finite seconds, at least 0"),
        (("--invariant", "bounded(5)", "--verbs", "cut,heal,shake"), "--verbs heal,shake: there are cut, lose"),
        (("--invariant", "bounded(5)", "--estimator", "guess"), "agents.estimator"),
    ],
    ids=[
        "fails undisturbed",
        "one of two fails undisturbed",
        "no checker",
        "no level",
        "no time",
        "no such verbs",
        "no such estimator",
    ],
)
def test_what_cannot_be_hunted_is_refused(options, says, capsys):
    assert commands.main(["hunt", "corridor", *BRIEF, *options]) == 2
    assert says in capsys.readouterr().err


def touched(verb, *words):
    """Fails under a fault of this verb on what any of these words selects."""

    def check(evidence: Evidence) -> CheckResult:
        wrong = [
            entry
            for entry in entries_of(evidence.plan.scenario)
            if entry["verb"] == verb and set(words) & {*entry.get("links", ()), *entry.get("agents", ())}
        ]
        return CheckResult("touched", "fail" if wrong else "pass", 0 if wrong else None, f"{len(wrong)} times")

    return Checker("touched", check)


SECOND = loading.load("corridor", ("time.dt=0.05", "time.duration=1", "network.availability=1.0"))
INSTANT = loading.load("corridor", ("time.dt=0.05", "time.duration=0.2", "network.availability=1.0"))


def hunted(*invariants, verbs, given=INSTANT, seeds=(1,), seed=1, budget=60, watch=lambda *_: None, corpus=()):
    quarry = Quarry(lambda: invariants, {(): given}, seeds, verbs)
    return hunt.hunt(quarry, budget=budget, seed=seed, watch=watch, each=flights.in_this_process, corpus=corpus)


def smallest_of(*invariants, **how):
    return [one.trial.faults for one in hunted(*invariants, **how).found]


def test_the_same_seed_hunts_the_same_and_another_does_not():
    chases = []
    for seed in (1, 1, 2):
        seen = []
        found = hunted(
            touched("freeze", "all", "min-cut"),
            verbs=["freeze"],
            seed=seed,
            watch=lambda coverage, broke, seen=seen: seen.append((coverage.schedules, broke)),
        )
        chases.append((seen, [(one.trial, one.digest) for one in found.found], found.coverage))
    assert chases[0] == chases[1]
    assert chases[0] != chases[2]


def test_no_fault_that_is_found_can_be_left_out():
    filtered = loading.load("corridor", ("time.dt=0.05", "time.duration=4", 'agents.estimator="rkf"'))
    (faults,) = smallest_of(checkers.bounded(5), verbs=["cut", "dropout"], given=filtered, budget=20)
    assert len(faults) == 1


def test_what_is_found_breaks_the_invariant_in_its_own_scenario():
    (smallest,) = hunted(cuts_off((2, 4), 1), verbs=["cut"], given=SECOND).found
    assert smallest.finding.verdict == "fail"
    assert said(smallest.scenario) | {"timeline": []} == said(SECOND)


def test_coverage_counts_what_is_met_and_names_what_never_was():
    coverage = covered.Coverage()
    cut, kill = Item(covered.VERB, "cut"), Item(covered.VERB, "kill")
    assert coverage.add([cut], vacuous=False)
    assert coverage.add([cut, kill], vacuous=True)
    assert not coverage.add([kill], vacuous=False)
    assert (coverage.schedules, coverage.vacuous) == (3, 1)
    assert coverage.of(covered.VERB) == {"cut": 2, "kill": 2}
    never = coverage.never(menu.menu(CORRIDOR, ["cut", "gust"]), 3)
    assert never[covered.VERB] == ["gust"]
    assert "all links of an agent" in never[covered.SELECTOR]
    assert "gust under cut" in never[covered.ORDER]
    assert never[covered.LINK] == ["cut"]
    assert never[covered.TOGETHER] == ["cut+cut", "cut+gust", "gust+gust"]


def test_a_trial_covers_what_its_faults_do_to_each_link_and_when():
    cut = {"verb": "cut", "at": 0.0, "lasts": 2.0, "links": ["2->4"]}
    late = {"verb": "delay", "at": 1.0, "lasts": 0.5, "links": ["2-4"], "delay": 0.1}
    dead = {"verb": "kill", "at": 3.0, "agents": [4]}
    trial = Trial((), 1, ([cut], [late], [dead]))
    met = covered.of(trial, planning.make(trial.in_scenario(CORRIDOR)))
    names = {kind: {item.name for item in met if item.kind == kind} for kind in covered.KINDS}
    assert names[covered.VERB] == {"cut", "delay", "kill"}
    assert names[covered.SELECTOR] == {"one-way link", "edge", "agent"}
    assert names[covered.THIRD] == {"cut, first third", "delay, first third", "kill, last third"}
    assert names[covered.ORDER] == {"delay under cut", "kill after cut", "kill after delay"}
    assert names[covered.LINK] == {"cut", "cut+delay", "delay", "kill"}
    assert names[covered.TOGETHER] == {"cut+delay", "cut+kill", "delay+kill"}


def test_every_schedule_flown_is_seen_and_counted():
    seen = []
    found = hunted(touched("gust"), verbs=["gust"], budget=10, watch=lambda c, _: seen.append(c.schedules))
    assert seen == list(range(1, 11))
    assert found.coverage.schedules == 10
    assert found.coverage.of(covered.VERB) == {"gust": 10}


def test_a_fault_that_touches_nothing_breaks_nothing():
    mute = loading.load("corridor", ("time.dt=0.05", "time.duration=0.2", 'agents.estimator="rkf"'))
    found = hunted(touched("lie", 1, "leaders", "followers"), verbs=["lie"], given=mute, budget=10)
    assert not found.found
    assert found.coverage.vacuous == found.coverage.schedules > 0


def test_an_invariant_that_is_never_put_to_the_test_is_not_broken():
    found = hunted(checkers.converged(1e-9, by=1.0), verbs=["cut"], budget=10)
    assert not found.found
    assert found.coverage.vacuous == found.coverage.schedules


def test_an_invariant_that_fails_undisturbed_is_no_quarry():
    with pytest.raises(ScenarioError, match="nothing to hunt for"):
        hunted(checkers.bounded(1e-9), verbs=["cut"])


def said(given):
    """A scenario without where it was read."""
    return given.model_dump()


def round_trip(given, path):
    path.write_text(loading.to_toml(given), encoding="utf-8")
    return said(loading.load(str(path)))


@pytest.mark.parametrize("name", loading.shipped())
def test_a_shipped_scenario_is_the_same_after_it_is_written(name, tmp_path):
    loaded = loading.load(name)
    assert round_trip(loaded, tmp_path / "again.toml") == said(loaded)


WILD = (
    "seed=18446744073709551615",
    'description="a \\"quoted\\" line\\nand ünïcode"',
    'network.profile="wild"',
    'network.profiles.wild={netem="delay 10ms 2ms 25% loss gemodel 1% 10% duplicate 1%"}',
    'network.profiles.list={like="wild",loss=[{model="list",messages=[3,5]}],corrupt=[{kind="bias",p=0.1,by=-0.5}]}',
    "network.coupled=false",
    'network.links=[{links="2->4",channels="sensing",availability=0.5}]',
    "network.zones=[{centre=[1.0,2.0],radius=3.0,share=0.25}]",
    "agents.parameters.ga-rkf.sigma_w=0.25",
    "record.enabled=false",
    timeline(
        {"verb": "cut", "name": "first", "when": {"tracking_error_above": 0.5, "lasting": 0.1}, "links": ["6-7"]},
        {
            "verb": "lose",
            "after": "first",
            "at": 0.1,
            "every": 0.5,
            "times": 3,
            "lasts": 0.2,
            "links": ["all"],
            "loss": 0.5,
        },
        {"verb": "pause", "at": 0.4, "agents": [4, "random 1 followers"]},
        {"verb": "resume", "at": 0.6, "agents": [4]},
        {"verb": "delay", "name": "second", "at": 0.25, "links": ["min-cut"], "delay": 0.1},
        {"verb": "heal", "at": 0.75, "names": ["second"]},
    ),
)


def test_a_scenario_that_says_everything_is_the_same_after_it_is_written(tmp_path):
    loaded = loading.load("corridor", WILD)
    assert round_trip(loaded, tmp_path / "again.toml") == said(loaded)


def test_any_schedule_is_the_same_after_it_is_written(tmp_path_factory):
    path = tmp_path_factory.mktemp("written") / "again.toml"

    @settings(
        max_examples=20,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    )
    @given(entries=strategies.schedules(CORRIDOR, strategies.VERBS))
    def same(entries):
        extended = loading.extended(CORRIDOR, entries)
        assert round_trip(extended, path) == said(extended)
        assert len(extended.timeline) == len(entries)

    same()


def test_what_is_written_flies_the_same_bits(tmp_path):
    overrides = ("time.dt=0.05", "time.duration=1", "network.coupled=false", *WILD[2:5], WILD[-1])
    (tmp_path / "again.toml").write_text(loading.to_toml(loading.load("corridor", overrides)), encoding="utf-8")
    assert digest_of(str(tmp_path / "again.toml")) == digest_of("corridor", *overrides)


def test_the_smallest_is_written_into_a_toml_file_or_not_at_all(capsys):
    with pytest.raises(SystemExit):
        commands.main(["hunt", "corridor", "--invariant", "bounded(5)", "--out", "found"])
    assert "call it found.toml" in capsys.readouterr().err


@pytest.mark.parametrize("verbs", [("cut", "lose", "delay"), ("dropout", "kill"), ("degrade", "partition")])
def test_schedules_that_fly_side_by_side_are_found_to_be_what_they_are_alone(verbs):
    filtered = loading.load("corridor", ("time.dt=0.05", "time.duration=4", "agents.estimator=rkf"))
    deck = Deck({(): filtered}, (1, 2), {(): menu.menu(filtered, verbs)})
    cases = [Case(filtered, trial) for trial in deck.drawn(3, 12)]
    make = flights.said(["bounded(3)", "never_heard_across_a_cut()"])
    together = flights.fly(make, cases)
    assert together == [one for case in cases for one in flights.fly(make, [case])]
    assert any(one.breaks(0) for one in together if one)
    assert len({one.digest for one in together if one}) > 6


def test_what_is_drawn_is_of_its_number_alone():
    deck = Deck({(): CORRIDOR}, range(1, 9), {(): menu.menu(CORRIDOR, strategies.VERBS)})
    drawn = [deck.draw(3, number) for number in range(40)]
    assert deck.draw(3, 17) == drawn[17]
    assert deck.draw(4, 17) != drawn[17]
    assert {trial.seed for trial in drawn} == set(range(1, 9))
    assert {len(trial.faults) for trial in drawn} == {1, 2, 3}


def test_one_flight_of_many_is_quicker_than_many_flights():
    given_to = loading.load("corridor", ("time.dt=0.05", "time.duration=6", "agents.estimator=rkf"))
    deck = Deck({(): given_to}, (1,), {(): menu.menu(given_to, ["cut", "lose", "dropout"])})
    cases = [Case(given_to, trial) for trial in deck.drawn(1, 24)]
    make = flights.said(["bounded(5)"])
    flights.fly(make, cases[:2])
    times = []
    for chunks in ([cases], [[case] for case in cases]):
        began = time.process_time()
        for chunk in chunks:
            flights.fly(make, chunk)
        times.append(time.process_time() - began)
    assert times[1] > 2.0 * times[0]


def planted(holds):
    """An invariant of the timeline alone: it fails where this does not hold of its faults."""

    def check(evidence: Evidence) -> CheckResult:
        broken = not holds(evidence)
        return CheckResult("planted", "fail" if broken else "pass", 0 if broken else None, "")

    return Checker("planted", check)


def cuts_off(pair, least):
    """Whether no cut of a link lasts so many ticks."""

    def holds(evidence):
        return not any(
            str(fault.verb) == "cut" and pair in fault.pairs and (fault.end or 20) - fault.start >= least
            for fault in evidence.plan.faults
        )

    return planted(holds)


def test_the_smallest_is_the_planted_one_in_time_and_extent():
    (faults,) = smallest_of(cuts_off((2, 4), 7), verbs=["cut", "lose"], given=SECOND, budget=200)
    assert faults == ([{"verb": "cut", "at": 0.0, "lasts": 0.35, "links": ["2->4"], "in_flight": "drop"}],)


def test_the_smallest_probability_is_the_planted_one_to_the_hundredth():
    weak = planted(
        lambda run: not any(fault.probability >= 0.34 and (3, 5) in fault.pairs for fault in run.plan.faults)
    )
    (((entry,),),) = smallest_of(weak, verbs=["lose"], given=SECOND, budget=200)
    assert (entry["loss"], entry["links"]) == (0.34, ["3->5"])


def test_a_partition_shrinks_to_the_links_that_it_has_to_cut():
    split = planted(
        lambda run: (
            not any(
                (now := run.timeline.at(tick)).cut[run.plan.world.links.index[3, 5]]
                or now.partitioned[run.plan.world.links.index[3, 5]]
                for tick in range(20)
            )
        )
    )
    (((entry,),),) = smallest_of(split, verbs=["partition"], given=SECOND, budget=60)
    assert (entry["verb"], entry["links"], entry["lasts"]) == ("cut", ["3->5"], 0.05)


def test_of_agents_as_few_as_do_it():
    pushed = planted(lambda run: not any(5 in fault.agents for fault in run.plan.faults))
    (((entry,),),) = smallest_of(pushed, verbs=["gust"], given=SECOND, budget=60)
    assert entry["agents"] == [5]
    assert entry["lasts"] == 0.05
    assert max(map(abs, entry["velocity"])) == 0.01


def test_each_invariant_has_its_own_smallest():
    found = hunted(
        cuts_off((2, 4), 5), checkers.bounded(1e9), cuts_off((6, 7), 2), verbs=["cut"], given=SECOND, budget=200
    )
    assert [(one.number, one.trial.faults[0][0]["links"], one.trial.faults[0][0]["lasts"]) for one in found.found] == [
        (0, ["2->4"], 0.25),
        (2, ["6->7"], 0.1),
    ]


def test_seeds_and_settings_are_drawn_and_the_plainest_that_break_it_are_kept():
    scenarios = {
        (words,): loading.load("corridor", ("time.dt=0.05", "time.duration=0.5", words))
        for words in ("network.availability=0.9", "network.availability=0.8")
    }
    picky = planted(
        lambda run: (
            not (run.plan.faults and run.plan.scenario.seed > 2 and run.plan.scenario.network.availability < 0.85)
        )
    )
    quarry = Quarry(lambda: [picky], scenarios, range(1, 6), ["cut"])
    found = hunt.hunt(quarry, budget=60, seed=1, watch=lambda *_: None, each=flights.in_this_process).found[0]
    assert found.trial.settings == ("network.availability=0.8",)
    assert found.scenario.network.availability == 0.8
    assert found.scenario.seed == found.trial.seed > 2


def test_where_seed_and_setting_are_of_no_matter_they_are_the_first():
    scenarios = {
        (words,): loading.load("corridor", ("time.dt=0.05", "time.duration=0.2", words))
        for words in ("network.availability=0.9", "network.availability=0.8", "network.availability=0.7")
    }
    quarry = Quarry(lambda: [planted(lambda run: not run.plan.faults)], scenarios, range(1, 9), ["cut"])
    for seed in (1, 2):
        found = hunt.hunt(quarry, budget=30, seed=seed, watch=lambda *_: None, each=flights.in_this_process).found[0]
        assert (found.trial.settings, found.trial.seed) == (("network.availability=0.9",), 1)


def test_a_hunt_over_seeds_and_settings_leaves_a_scenario_that_has_them(den, capsys):
    options = (
        "--seeds",
        "3-4",
        "--sweep",
        "network.availability=0.35,0.3",
        "--invariant",
        "bounded(5)",
        "--verbs",
        "cut",
    )
    assert commands.main(["hunt", "corridor", *BRIEF, "--duration", "4", *options, "--budget", "30", "--json"]) == 1
    found = json.loads(capsys.readouterr().out.splitlines()[-1])["found"]
    (one,) = found
    again = loading.load(str(den / "hunted-corridor.toml"))
    assert again.seed == one["seed"] in (3, 4)
    assert one["settings"] == [f"network.availability={again.network.availability:g}"]


def both_at_once(least):
    """Whether a link is never cut in so many ticks in which another loses enough."""

    def ticks(evidence, verb, pair, share):
        return {
            tick
            for fault in evidence.plan.faults
            if str(fault.verb) == verb and pair in fault.pairs and fault.probability >= share
            for tick in range(fault.start, fault.end or evidence.plan.world.ticks)
        }

    return planted(lambda run: len(ticks(run, "cut", (2, 4), 0.0) & ticks(run, "lose", (3, 5), 0.2)) < least)


def test_two_faults_that_break_it_together_are_each_as_short_small_and_weak_as_can_be():
    ((one, other),) = smallest_of(both_at_once(3), verbs=["cut", "lose"], given=SECOND, budget=600)
    ((cut,), (lose,)) = sorted((one, other), key=lambda fault: fault[0]["verb"])
    assert (cut["links"], cut["at"], cut["lasts"]) == (["2->4"], 0.0, 0.15)
    assert (lose["links"], lose["at"], lose["lasts"], lose["loss"]) == (["3->5"], 0.0, 0.15, 0.2)


@pytest.mark.usefixtures("den")
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--sweep", "seed=5,6"), "--sweep seed: the seeds of runs are given by --seeds"),
        (("--sweep", "network.availability=1", "--sweep", "network.availability=0.5"), "it is swept twice"),
        (("--sweep", "network.availability=1", "--availability", "0.3"), "network.availability=0.3 is given as well"),
        (("--seeds", "1-2", "--set", "seed=3"), "--seeds and a seed: give the one or the other"),
        (("--every", ""), "--every"),
        (("--frontier", "nodir/x.png"), "--frontier nodir/x.png: there is no directory nodir"),
    ],
)
def test_what_would_be_dropped_without_a_word_is_refused(capsys, words, says):
    assert commands.main(["hunt", "corridor", *BRIEF, "--invariant", "bounded(5000)", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


@pytest.mark.usefixtures("den")
@pytest.mark.parametrize(
    "more", [("--budget", "3"), ("--frontier", "x.png", "--seeds", "1-2")], ids=["hunt", "frontier"]
)
def test_where_nothing_was_put_to_the_test_nothing_is_proved(capsys, more):
    assert commands.main(["hunt", "corridor", *BRIEF, "--duration", "1", "--invariant", "found(0.1, 1)", *more]) == 1
    assert re.search("put (it )?to the test", capsys.readouterr().err)
