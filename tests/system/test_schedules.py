"""Random schedules of faults: whatever is drawn flies, and the run says what came of it."""

from collections import Counter

import numpy as np
import pytest
from flying import PROCESSES, plan_of
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario import verbs as verb_models
from affinet.scenario.wrong import ScenarioError
from affinet.testing import strategies
from affinet.verdicts import checkers
from tests.system.test_runtimes import OCTAHEDRON

pytestmark = PROCESSES

ENDERS = {"heal", "restart", "resume", "rejoin", "replace"}
ESTIMATORS = ("ga-rkf", "rkf", "conral", "ral", "none", "edge-kf", "joint-kf")
COARSE = ("time.dt=0.05", "time.duration=4")
CORRIDOR = loading.load("corridor", COARSE)
SCHEDULES = strategies.schedules(CORRIDOR, strategies.VERBS)


def repeatable(examples):
    """The same examples every time, as many as these."""
    silent = [HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large]
    return settings(max_examples=examples, derandomize=True, database=None, deadline=None, suppress_health_check=silent)


def some_then_all(some, everything):
    """How many schedules: some, and everything in the slow set."""
    return pytest.mark.parametrize("number", [some, pytest.param(everything, marks=pytest.mark.slow)])


def plan_under(entries, estimator):
    """The corridor under a schedule; schedules that restart an agent twice at once are none."""
    given_to = loading.load("corridor", (*COARSE, f'agents.estimator="{estimator}"'))
    try:
        return planning.make(loading.extended(given_to, entries))
    except ScenarioError as error:
        if "is under no kill then" not in str(error):
            raise
        reject()


def strange(run):
    """What is not finite in a run though it should be."""
    arrays = run.arrays
    said = {name: arrays[name][arrays["known"]] for name in ("estimate", "covariance")}
    flown = {name: arrays[name] for name in ("position", "input")}
    return [name for name, values in (flown | said).items() if not np.isfinite(values).all()]


@pytest.mark.timeout(1800)
@some_then_all(10, 300)
def test_any_schedule_flies_and_its_accounts_close(number):
    verdicts = Counter()

    @repeatable(number)
    @given(entries=SCHEDULES, estimator=st.sampled_from(ESTIMATORS))
    def flies(entries, estimator):
        plan = plan_under(entries, estimator)
        run = rehearse(plan)
        verdicts[run.outcome.verdict] += 1
        assert run.ticks == 80
        assert run.outcome.verdict == "fail" or not strange(run), strange(run)
        messages = run.outcome.messages
        booked = messages["delivered"] + sum(messages["dropped"].values()) + messages["in_flight"]
        assert messages["offered"] + messages["copies"] == booked
        assert checkers.never_heard_across_a_cut()(run).verdict != "fail"
        assert rehearse(plan).outcome.digest == run.outcome.digest

    flies()
    assert verdicts["pass"] > number / 3, verdicts


@pytest.mark.timeout(1800)
@some_then_all(2, 50)
def test_any_schedule_gives_the_same_bits_over_processes(number, tmp_path_factory):
    @repeatable(number)
    @given(entries=SCHEDULES, estimator=st.sampled_from(ESTIMATORS))
    def agree(entries, estimator):
        plan = plan_under(entries, estimator)
        flown = fly(plan, "processes", tmp_path_factory.mktemp("flown") / "run", lambda *_: None)
        rehearsed = rehearse(plan).outcome
        assert (flown.digest, flown.verdict) == (rehearsed.digest, rehearsed.verdict), flown.reasons
        assert flown.messages["uninstructed"] == 0
        assert flown.faults == rehearsed.faults

    agree()


def test_every_verb_that_begins_something_is_drawn():
    assert set(strategies.VERBS) == set(verb_models.VERBS) - ENDERS


def test_schedules_draw_every_verb():
    drawn, sizes = set(), set()

    @repeatable(150)
    @given(entries=SCHEDULES)
    def draw(entries):
        verbs = [entry["verb"] for entry in entries]
        drawn.update(verbs)
        sizes.add(sum(verb not in ENDERS for verb in verbs))

    draw()
    assert drawn == {*strategies.VERBS, "restart"}
    assert sizes == {1, 2, 3}


@pytest.fixture(scope="module")
def octahedron(tmp_path_factory):
    """A formation in space."""
    path = tmp_path_factory.mktemp("scenarios") / "octahedron.toml"
    path.write_text(OCTAHEDRON)
    return loading.load(str(path))


@pytest.mark.parametrize("verb", strategies.VERBS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_every_fault_of_a_verb_fits_the_plane_and_space(verb, dimension, octahedron):
    swarm = plan_of("corridor", *COARSE).scenario if dimension == 2 else octahedron

    @repeatable(8)
    @given(entries=strategies.faults(swarm, [verb]))
    def fits(entries):
        assert entries[0]["verb"] == verb
        plan = planning.make(loading.extended(swarm, entries))
        assert {fault.verb for fault in plan.faults} == {verb}
        assert all(fault.start < plan.world.ticks for fault in plan.faults)

    fits()


@pytest.mark.parametrize("chosen", [["cut"], ["cut", "gust"]], ids=",".join)
def test_schedules_keep_to_the_verbs_they_are_given(chosen):
    @repeatable(50)
    @given(entries=strategies.schedules(CORRIDOR, chosen, most=2))
    def keeps(entries):
        assert 1 <= len(entries) <= 2
        assert {entry["verb"] for entry in entries} <= set(chosen)

    keeps()


def test_times_are_whole_ticks_within_the_run():
    @repeatable(50)
    @given(entries=SCHEDULES)
    def whole(entries):
        for entry in entries:
            for seconds in (entry["at"], entry.get("lasts", 0.05)):
                assert round(seconds / 0.05) == pytest.approx(seconds / 0.05, abs=1e-6)
            assert entry["verb"] in ENDERS or entry["at"] < 4.0

    whole()
