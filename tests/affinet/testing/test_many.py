"""A check over many seeds: what is decided of planted runs, after how many, and what is said of those that fail."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from flying import plan_of
from own_code import ESTIMATOR, write
from own_code import broken as broken_text

from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.testing.many import FlownSeeds, seeds_of
from affinet.testing.swarm import SwarmRuns
from affinet.verdicts.checkers import bounded, recovers
from affinet.verdicts.checking import Checker, CheckResult
from affinet.verdicts.flown import Broken

SHORT = ("time.dt=0.05", "time.duration=1")


class Planted:
    """Runs that come to what is planted, by seed, and count how often they fly."""

    def __init__(self, verdicts):
        self.verdicts = dict(enumerate(verdicts, 1))
        self.flown = []
        self.seeds = FlownSeeds(loading.load("corridor", SHORT), range(1, len(verdicts) + 1), self._launch)

    def _launch(self, plans):
        self.flown += [plan.scenario.seed for plan in plans]
        return [
            SimpleNamespace(
                plan=plan,
                outcome=SimpleNamespace(verdict="pass", reasons=()),
                error=np.array([0.1, plan.scenario.seed / 10]),
                dt=plan.world.dt,
            )
            for plan in plans
        ]

    def check(self, **asked):
        planted = Checker("planted()", lambda run: self._found(run.plan.scenario.seed))
        return self.seeds.check(planted, **asked)

    def _found(self, seed):
        return CheckResult("planted()", self.verdicts[seed], 3, f"seed {seed} is so")


def broken(verdicts, **asked):
    planted = Planted(verdicts)
    with pytest.raises(Broken):
        planted.check(**asked)
    return planted.seeds.asked[0], planted


def mixed(passes, fails, vacuous=0):
    """Verdicts spread evenly over the seeds."""
    rows = ["pass"] * passes + ["fail"] * fails + ["vacuous"] * vacuous
    order = np.random.default_rng(1).permutation(len(rows))
    return [rows[place] for place in order]


def test_what_holds_for_all_is_decided_at_half_of_the_runs():
    planted = Planted(["pass"] * 200)
    result = planted.check(share=0.95)
    assert (result.verdict, len(result.passed), result.flown, result.failed) == ("holds", 100, 100, ())
    assert planted.flown == list(range(1, 101))
    assert result.share.low > 0.95
    assert "decided after 100 of 200 runs" in str(result)


def test_what_fails_often_is_decided_at_the_first_look():
    result, planted = broken(mixed(100, 100), share=0.95)
    assert (result.verdict, result.flown, len(planted.flown)) == ("fails", 25, 25)
    assert result.share.high < 0.95


def test_what_is_near_the_share_flies_all_and_is_undecided():
    result, _ = broken(mixed(190, 10), share=0.95)
    assert (result.verdict, result.flown) == ("undecided", 200)
    assert result.share.low < 0.95 < result.share.high
    assert "decided after" not in str(result)


def test_more_confidence_asks_for_more_runs():
    planted = Planted(["pass"] * 200)
    assert planted.check(share=0.95, confidence=0.999).flown == 200


def test_runs_that_put_nothing_to_the_test_are_no_part_of_the_share():
    planted = Planted(mixed(150, 0, vacuous=50))
    result = planted.check(share=0.9)
    assert (result.verdict, result.share.found) == ("holds", 1.0)
    assert len(result.passed) + len(result.vacuous) == result.flown
    assert len(result.vacuous) > 5
    assert "put nothing to the test" in str(result)
    # Nothing is known of a share of 50 runs that it takes 100 for.
    result, _ = broken(mixed(50, 0, vacuous=150), share=0.95)
    assert (result.verdict, result.flown) == ("undecided", 200)


def test_where_no_run_puts_it_to_the_test_it_is_vacuous():
    result, _ = broken(["vacuous"] * 8, share=0.5)
    assert (result.verdict, result.flown) == ("vacuous", 8)
    result, _ = broken(["vacuous"] * 8)
    assert result.verdict == "vacuous"


def test_without_a_share_every_run_has_to_pass():
    assert Planted(["pass"] * 30).check().flown == 30
    result, _ = broken(["pass"] * 5 + ["fail"] + ["pass"] * 34)
    assert (result.verdict, result.asked, [one.seed for one in result.failed]) == ("fails", None, [6])
    assert result.flown == 10  # of 40: the look after a quarter is the first that sees it


def test_those_that_fail_are_named_and_the_worst_is_the_one_with_the_largest_error():
    result, _ = broken(["fail", "pass"] * 20, share=0.9)
    assert [one.seed for one in result.failed] == list(range(1, 1 + result.flown, 2))
    assert result.worst == max(result.failed, key=lambda one: one.seed)
    assert result.worst.at == pytest.approx(3 * 0.05)
    first, *others = str(result).split("\n  ")
    assert first.startswith(f"planted(): fails: {len(result.passed)} of {result.flown} runs pass, ")
    assert "and 90 % have to" in first
    assert others[-1] == f"the worst, seed {result.worst.seed}: planted(): fail: seed {result.worst.seed} is so"


@pytest.mark.parametrize(
    "asked", [{"share": 0.0}, {"share": 1.0}, {"share": 95}, {"confidence": 1.0}, {"share": 0.9, "confidence": 0}]
)
def test_a_share_that_is_none_is_refused_before_anything_flies(asked):
    planted = Planted(["pass"] * 4)
    with pytest.raises(ValueError, match="give a number between 0 and 1"):
        planted.check(**asked)
    assert planted.flown == []


def test_seeds_are_so_many_from_the_first_on_or_those_that_are_given():
    assert list(seeds_of(7, 3)) == [7, 8, 9]
    assert seeds_of(7, [4, 1]) == (4, 1)
    for odd in (0, -3, [], [1, 1], [1.0], [True], [-1], [2**64]):
        with pytest.raises(ValueError, match="seeds"):
            seeds_of(1, odd)
    for odd in (1.5, True, "12", None):
        with pytest.raises((TypeError, ValueError), match="seeds"):
            seeds_of(1, odd)


@cache
def alone(seed):
    return rehearse(plan_of("corridor", *SHORT, f"seed={seed}"))


def test_each_run_of_a_swarm_is_the_run_of_its_seed(tmp_path):
    runs = SwarmRuns("inprocess", None, lambda: tmp_path, tmp_path)
    seen = {}

    def look(run):
        seen[run.plan.scenario.seed] = run.outcome.digest
        return CheckResult("look", "pass", None, "looked")

    result = runs("corridor", *SHORT).fly(seeds=[5, 3, 8]).check(look, bounded(1e3))
    assert result.passed == (5, 3, 8)
    assert seen == {seed: alone(seed).outcome.digest for seed in (5, 3, 8)}
    assert list(seen) == [5, 3, 8]


def test_a_run_that_fails_or_is_vacuous_by_itself_counts_as_such(tmp_path):
    runs = SwarmRuns("inprocess", None, lambda: tmp_path, tmp_path)
    late = runs("corridor", *SHORT).fault("cut", links="1-2", at=9).fly(seeds=3)
    with pytest.raises(Broken, match="vacuous"):
        late.check()
    lost = runs("corridor", *SHORT, "agents.estimator=conral", "time.duration=2")
    lost = lost.fault("lie", agents=["all"], at=0, matrix=[[1e9, 0.0], [0.0, 1e9]]).fly(seeds=2)
    with pytest.raises(Broken, match="the swarm diverged"), np.errstate(all="ignore"):
        lost.check(recovers(1, within=1))
    assert lost.asked[0].worst.worst > 1e9


def test_a_verdict_is_of_one_run(tmp_path):
    runs = SwarmRuns("inprocess", None, lambda: tmp_path, tmp_path)
    with pytest.raises(ValueError, match="say in `check` which share has to pass"):
        runs("corridor", *SHORT).fly("fail", seeds=3)


def test_an_estimator_that_fails_is_named_with_the_seed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    name = write(
        tmp_path, broken_text(ESTIMATOR, ("late = np", "late = np.abs(state.measured).max() > 5.5 and 1 / 0 or np"))
    )
    runs = SwarmRuns("inprocess", None, lambda: tmp_path, tmp_path)
    swarm = runs("corridor", *SHORT, "agents.law=rest", f"agents.estimator={name}:Own")

    def fails(seed):
        try:
            swarm.fly(seeds=[seed]).check()
        except Broken as error:
            return str(error)
        return None

    said = {seed: fails(seed) for seed in range(1, 9)}
    first = next(seed for seed, says in said.items() if says)
    assert None in said.values()
    with pytest.raises(Broken) as caught:
        swarm.fly(seeds=8).check(share=0.5)
    assert str(caught.value) == said[first]
    assert said[first].startswith(f"seed {first}: {name}:Own.fuse in tick ")
