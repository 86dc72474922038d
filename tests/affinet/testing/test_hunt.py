"""The hunt for the smallest fault that breaks an invariant."""

import sys

import pytest
from flying import PROCESSES, digest_of
from hypothesis import HealthCheck, given, settings
from scripted import timeline

from affinet.cli import commands, hunting
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.testing import hunt, strategies
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
    assert entry.at == 0.0
    assert entry.until is entry.lasts is None
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
    smallest = hunt.Counterexample(CORRIDOR, CheckResult("bounded(5)", "fail", 3, "x"), "digest")
    monkeypatch.setattr(hunt, "hunt", lambda *_, **__: (smallest, hunt.Coverage()))
    monkeypatch.setattr(hunting, "_confirm", lambda *_: None)
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


INSTANT = loading.load("corridor", ("time.dt=0.05", "time.duration=0.2", "network.availability=1.0"))


def hunted(invariant, *, verbs, seed=1, budget=60, watch=lambda *_: None):
    return hunt.hunt(INSTANT, invariant, budget=budget, verbs=verbs, seed=seed, watch=watch)


@pytest.mark.slow
def test_the_same_seed_hunts_the_same_and_another_does_not():
    chases = []
    for seed in (1, 1, 2):
        seen = []
        smallest, coverage = hunted(
            touched("freeze", "all", "min-cut"),
            verbs=["freeze"],
            seed=seed,
            watch=lambda coverage, broke, seen=seen: seen.append((coverage.schedules, broke)),
        )
        chases.append((seen, smallest and (entries_of(smallest.scenario), smallest.digest), coverage))
    assert chases[0] == chases[1]
    assert chases[0] != chases[2]


def test_no_fault_that_is_found_can_be_left_out():
    given_to = loading.load("corridor", ("time.dt=0.05", "time.duration=2", 'agents.estimator="rkf"'))
    smallest, _ = hunt.hunt(
        given_to, checkers.bounded(5), budget=20, verbs=["cut", "dropout"], seed=1, watch=lambda *_: None
    )
    assert len(smallest.scenario.timeline) == 1


def test_what_is_found_breaks_the_invariant_and_is_permanent_from_the_start():
    smallest, _ = hunted(touched("dropout", "all", "1", "min-cut"), verbs=["dropout"])
    assert smallest.finding.verdict == "fail"
    assert all(entry["at"] == 0.0 and "lasts" not in entry for entry in entries_of(smallest.scenario))
    assert said(smallest.scenario) | {"timeline": []} == said(INSTANT)


def test_coverage_counts_verbs_and_kinds_of_selectors():
    coverage = hunt.Coverage()
    coverage.add([{"verb": "cut", "links": ["2->4"]}, {"verb": "cut", "links": ["2-4", "min-cut"]}])
    coverage.add([{"verb": "kill", "agents": [4]}, {"verb": "partition", "groups": "halves"}])
    assert coverage.schedules == 2
    assert coverage.verbs == {"cut": 2, "kill": 1, "partition": 1}
    assert coverage.selectors == {"one-way link": 1, "edge": 1, "min-cut": 1, "agent": 1, "halves": 1}


def test_every_schedule_flown_is_seen_and_counted():
    seen = []
    _, coverage = hunted(touched("gust"), verbs=["gust"], budget=10, watch=lambda c, _: seen.append(c.schedules))
    assert seen == list(range(1, 11))
    assert coverage.schedules == 10
    assert set(coverage.verbs) == {"gust"}
    assert sum(coverage.selectors.values()) >= sum(coverage.verbs.values())


def test_a_fault_that_touches_nothing_breaks_nothing():
    mute = loading.load("corridor", ("time.dt=0.05", "time.duration=0.2", 'agents.estimator="rkf"'))
    smallest, coverage = hunt.hunt(
        mute, touched("lie", 1, "leaders", "followers"), budget=10, verbs=["lie"], seed=1, watch=lambda *_: None
    )
    assert smallest is None
    assert coverage.vacuous == coverage.schedules > 0


def test_an_invariant_that_is_never_put_to_the_test_is_not_broken():
    smallest, coverage = hunted(checkers.converged(1e-9, by=1.0), verbs=["cut"], budget=10)
    assert smallest is None
    assert coverage.vacuous == coverage.schedules


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


@pytest.mark.parametrize(
    ("level", "verbs"), [(1e9, ("cut", "lose", "delay")), (5.0, ("dropout", "kill")), (3.0, ("cut", "bias"))]
)
def test_schedules_that_fly_side_by_side_are_found_to_be_what_they_are_alone(level, verbs, monkeypatch):
    filtered = loading.load("corridor", ("time.dt=0.05", "time.duration=4", "agents.estimator=rkf"))

    def hunted():
        seen = []
        found, coverage = hunt.hunt(
            filtered,
            checkers.bounded(level),
            budget=20,
            verbs=verbs,
            seed=3,
            watch=lambda coverage, broken: seen.append((coverage.schedules, coverage.vacuous, broken)),
        )
        return (found and (found.scenario, found.finding, found.digest)), coverage, seen

    batches, fly = [], hunt.rehearse_all
    monkeypatch.setattr(hunt, "rehearse_all", lambda plans: batches.append(len(plans)) or fly(plans))
    together = hunted()
    assert max(batches) > 4
    monkeypatch.setattr(hunt, "rehearse_all", lambda plans: [hunt.rehearse(plan) for plan in plans])
    assert hunted() == together
    assert (together[0] is None) == (level == 1e9)
