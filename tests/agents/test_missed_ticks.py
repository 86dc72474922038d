"""Ticks that an agent missed: who is told, of how many, and what estimators make of them."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pytest
from briefs import BRIEF
from flying import plan_of
from rows.case import leaves as arrays_of

from agents.agent import Agent
from agents.algebra import missed_ticks
from agents.brief import Gap, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator
from agents.estimators.conral import ConsensusLocalization
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.ga_rkf import GeometryAwareFilter
from agents.estimators.imm import InteractingMultipleModel
from agents.estimators.joint_kf import JointEdgeFilter
from agents.estimators.rkf import RelativeKalmanFilter
from agents.estimators.silent import SilentEdgeFilter
from agents.estimators.target import TargetEstimator
from agents.exchange import Heard
from agents.laws.double import DoubleConstantVelocity
from agents.laws.single import Static
from analysis.models.pursuit import Sighting
from netem.core.channels import INPUT
from netem.processes.user_code import UserCodeError

SEEN = np.array([True, False, False])
FLOWN = np.array([0.3, -0.2])


def leaves(value):
    return [*arrays_of(value)]


class Told(NamedTuple):
    """What it was told last: ticks, and velocities."""

    ticks: np.ndarray
    before: np.ndarray
    within: np.ndarray


@dataclass(frozen=True)
class Plain:
    """It has no word for missed ticks."""

    def channels(self, _brief):
        return {}

    def init(self, brief, batch):
        nothing = np.zeros((*batch, brief.dimension))
        return Told(np.zeros(batch, dtype=np.int64), nothing, nothing)

    def sense(self, _brief, state, _measured, _seen):
        return state, {}

    def fuse(self, brief, state, _heard, _own):
        known = np.zeros_like(brief.present)
        nothing = np.zeros((*known.shape, brief.dimension))
        return state, Estimate(nothing, known, np.zeros((*nothing.shape, brief.dimension)), no_indicator(known))


@dataclass(frozen=True)
class Listening(Plain):
    def missed(self, _brief, _state, gap):
        return Told(*(np.array(each) for each in gap))


@dataclass(frozen=True)
class Inheriting(Plain, Estimator):
    """It has the word of the base class."""


def agent(estimator, law=None):
    return Agent(BRIEF, estimator, law or Static(), leaders="pilot", leader_gain=1.0, limit=None)


def sensed(one, state, tick, motion=None):
    return one.sense(state, tick, BRIEF.relative, SEEN, motion)


def flying(one, tick):
    return sensed(one, one.init(()), tick)[0]._replace(input=FLOWN)


def test_who_goes_on_is_told_how_many_ticks_it_missed_and_that_its_body_flew_on():
    one = agent(Listening())
    state, said = sensed(one, flying(one, 7), 12)
    assert state.estimator.ticks == 4
    for told in (state.estimator.before, state.estimator.within, said[INPUT]["velocity"], state.input):
        np.testing.assert_array_equal(told, FLOWN)
    assert sensed(one, state, 13)[0].estimator.ticks == 4  # nothing missed, so it is not told again


def test_who_was_dead_knows_that_its_body_held_and_does_not_say_that_it_flies():
    one = agent(Listening())
    state, said = sensed(one, one.revived(flying(one, 7)), 12)
    np.testing.assert_array_equal(state.estimator.before, FLOWN)  # until it died
    for still in (state.estimator.within, said[INPUT]["velocity"], state.input):
        np.testing.assert_array_equal(still, np.zeros(2))
    later, _ = sensed(one, state._replace(input=FLOWN), 15)  # and paused, once it flies again
    np.testing.assert_array_equal(later.estimator.within, FLOWN)


@pytest.mark.parametrize("first", [0, 5])
def test_who_never_sensed_has_missed_nothing(first):
    one = agent(Listening())
    for state in (one.init(()), one.revived(one.init(()))):
        assert sensed(one, state, first)[0].estimator.ticks == 0


def test_bodies_that_are_told_their_velocity_take_that():
    one = agent(Listening(), DoubleConstantVelocity())
    motion = np.array([[2.0, 3.0]])
    state, _ = sensed(one, sensed(one, one.init(()), 0, motion)[0]._replace(input=FLOWN), 3, motion)
    for told in (state.estimator.before, state.estimator.within):
        np.testing.assert_array_equal(told, motion[0])


@pytest.mark.parametrize("estimator", [Plain(), Inheriting()])
def test_estimators_that_do_not_care_go_on_as_they_were(estimator):
    one = agent(estimator)
    before = flying(one, 0)
    for now, then in zip(leaves(sensed(one, before, 9)[0].estimator), leaves(before.estimator), strict=True):
        assert now.tobytes() == then.tobytes()


def test_in_a_batch_those_who_missed_nothing_are_left_alone():
    one = replace(agent(Listening()), brief=replace(BRIEF, present=np.broadcast_to(BRIEF.present, (3, 3))))
    state, _ = one.sense(one.init((3,)), 4, np.zeros((3, 3, 2)), np.zeros((3, 3), dtype=bool), None)
    state = state._replace(input=np.ones((3, 2)), sensed=np.array([4, 2, -1]))
    state, _ = one.sense(state, 5, np.zeros((3, 3, 2)), np.zeros((3, 3), dtype=bool), None)
    np.testing.assert_array_equal(state.estimator.ticks, [0, 2, 0])
    np.testing.assert_array_equal(state.estimator.within, [[0, 0], [1, 1], [0, 0]])
    np.testing.assert_array_equal(state.sensed, [5, 5, 5])


@pytest.mark.parametrize(
    ("returned", "says"),
    [(lambda state: state.ticks, "must be a Told, as before"), (lambda state: state[9], "IndexError")],
)
def test_what_it_does_wrong_with_them_is_said_as_its_own(returned, says):
    wrong = type("Wrong", (Plain,), {"missed": lambda _self, _brief, state, _gap: returned(state)})()
    one = agent(wrong)
    with pytest.raises(UserCodeError, match=f"Wrong.missed: .*{says}"):
        sensed(one, flying(one, 0), 9)


# ---- what the filters make of them


ENTERED, WITHIN = np.array([0.4, 0.1]), np.array([-0.2, 0.3])
GAPS = [1, 2, 7]
KNOWING = {"coefficients": (0.8, -0.1), "sigma_n": 0.1}
LIVED = {
    "rkf": RelativeKalmanFilter(),
    "rkf-random-walk": RelativeKalmanFilter(model="random-walk"),
    "imm": InteractingMultipleModel(),
    "edge-kf": EdgeKalmanFilter(**KNOWING),
    "joint-kf": JointEdgeFilter(**KNOWING),
}
PLACE = replace(BRIEF, process=0.01 * np.eye(6), persistence=0.6, lateness=3)


def own(tick):
    flown = ENTERED if tick == 0 else WITHIN
    return Own(flown, flown, tick)


def deaf(brief, estimator):
    return {
        name: Heard({of: np.zeros((3, *f.shape), dtype=f.dtype) for of, f in fields.items()}, np.zeros(3, dtype=bool))
        for name, fields in {**estimator.channels(brief), INPUT: {"velocity": np.zeros(2)}}.items()
    }


def grown(estimator, brief):
    """A state after some ticks in which it measured and heard."""
    rng, state = np.random.default_rng(3), estimator.init(brief, ())
    for tick in range(5):
        state, said = estimator.sense(brief, state, brief.relative + 0.1 * rng.normal(size=(3, 2)), brief.present)
        spread = {
            name: {of: np.stack([f if f.dtype == bool else 1.1 * f] * 3) for of, f in fields.items()}
            for name, fields in said.items()
        }
        heard = {name: Heard(fields, brief.present) for name, fields in spread.items()}
        heard[INPUT] = Heard({"velocity": rng.normal(size=(3, 2))}, brief.present)
        state, _ = estimator.fuse(brief, state, heard, own(tick))
    return state


@pytest.mark.parametrize("ticks", GAPS)
@pytest.mark.parametrize("estimator", LIVED.values(), ids=LIVED)
def test_a_filter_comes_out_as_one_that_was_awake_and_neither_measured_nor_heard(estimator, ticks):
    before = grown(estimator, PLACE)
    gap = Gap(np.array(ticks), ENTERED, WITHIN)
    # What it measured last is told by the tick that follows, and nothing asks for it here.
    state = before
    for tick in range(ticks):
        state, _ = estimator.sense(PLACE, state, np.zeros((3, 2)), np.zeros(3, dtype=bool))
        state, _ = estimator.fuse(PLACE, state, deaf(PLACE, estimator), own(tick))
    found, expected = (
        estimator.sense(PLACE, one, PLACE.relative, SEEN)[0] for one in (estimator.missed(PLACE, before, gap), state)
    )
    for one, other in zip(leaves(found), leaves(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12)
    spread = [
        np.trace(np.asarray(leaf), axis1=-2, axis2=-1).sum()
        for one in (found, before)
        for leaf in leaves(one)
        if np.ndim(leaf) >= 2 and leaf.shape[-1] == leaf.shape[-2]
    ]
    assert len(set(spread)) > 1  # and not as one that missed nothing


BEGINS_AGAIN = {"edge-kf": EdgeKalmanFilter(), "joint-kf": JointEdgeFilter(), "silent-kf": SilentEdgeFilter()}


def equal(one, other):
    return all(a.tobytes() == b.tobytes() for a, b in zip(leaves(one), leaves(other), strict=True))


@pytest.mark.parametrize("estimator", BEGINS_AGAIN.values(), ids=BEGINS_AGAIN)
def test_who_does_not_doubt_its_guesses_begins_again(estimator):
    before = grown(estimator, PLACE)
    again = estimator.missed(PLACE, before, Gap(np.array(1), ENTERED, WITHIN))
    assert equal(again, estimator.init(PLACE, ()))
    assert not equal(again, before)


@pytest.mark.parametrize("estimator", [LIVED["imm"], LIVED["edge-kf"], LIVED["joint-kf"]])
def test_who_missed_too_many_begins_again(estimator, monkeypatch):
    monkeypatch.setattr(missed_ticks, "LONGEST", 5)
    before = grown(estimator, PLACE)
    after = [estimator.missed(PLACE, before, Gap(np.array(ticks), ENTERED, WITHIN)) for ticks in (5, 6)]
    assert [equal(one, estimator.init(PLACE, ())) for one in after] == [False, True]


def test_many_ticks_of_a_model_of_motion_take_no_longer_than_a_few():
    rkf = RelativeKalmanFilter(model="random-walk", sigma_w=0.5)
    state = grown(rkf, PLACE)
    later = rkf.missed(PLACE, state, Gap(np.array(10**6), ENTERED, WITHIN))
    gained = 1e6 * 0.5 * 0.5 * PLACE.dt * PLACE.dt
    np.testing.assert_allclose(later.covariance - state.covariance, np.broadcast_to(gained * np.eye(2), (3, 2, 2)))


@pytest.mark.parametrize("geometry", ["conral", "ral"])
def test_ga_rkf_coasts_and_its_indicator_ages(geometry):
    ga_rkf, rkf = GeometryAwareFilter(geometry=geometry), RelativeKalmanFilter()
    before, gap = grown(ga_rkf, PLACE), Gap(np.array(4), ENTERED, WITHIN)
    after = ga_rkf.missed(PLACE, before, gap)
    assert equal(after.tracks, rkf.missed(PLACE, before.tracks, gap))
    assert not equal(after.tracks, before.tracks)
    if geometry == "conral":
        conral = ConsensusLocalization()
        shape = before.shape
        for tick in range(4):
            shape, _ = conral.sense(PLACE, shape, np.zeros((3, 2)), np.zeros(3, dtype=bool))
            shape, _ = conral.fuse(PLACE, shape, deaf(PLACE, conral), own(tick))
        assert equal(after.shape.indicator, shape.indicator)
        assert after.shape.indicator.psi == pytest.approx(25 * before.shape.indicator.psi)
        assert before.shape.indicator.psi > 0.0


# ---- a target


@pytest.mark.parametrize("given", [{}, {"output": "low-pass"}, {"fusion": "none"}, {"fusion": "mean"}], ids=str)
def test_what_is_known_of_a_target_is_that_of_an_agent_that_heard_and_found_nothing(given, monkeypatch):
    brief = plan_of("target", "time.duration=0.2").brief.of(4)
    estimator, rng, slots = TargetEstimator(**given), np.random.default_rng(5), brief.present.shape

    def heard(said, fresh):
        spread = {
            name: {of: np.stack([f] * slots[0]) * rng.normal() for of, f in fields.items()}
            for name, fields in said.items()
        }
        return {name: Heard(fields, np.full(slots, fresh)) for name, fields in spread.items()}

    def lives(state, tick, fresh, done):
        state, said = estimator.sense(brief, state, brief.relative, brief.present)
        sighting = Sighting(rng.normal(size=2), np.array(done), np.array(0), np.array(0))
        return estimator.fuse(brief, state, heard(said, fresh), Own(FLOWN, FLOWN, tick, FLOWN, sighting))[0]

    state = estimator.init(brief, ())
    for tick in range(6):
        state = lives(state, tick, fresh=True, done=tick in (1, 4))
    deaf = state
    for tick in range(6, 13):
        deaf = lives(deaf, tick, fresh=False, done=False)
    after = estimator.missed(brief, state, Gap(np.array(7), FLOWN, FLOWN))
    assert equal(after, deaf)
    assert not equal(after, state)
    monkeypatch.setattr(missed_ticks, "LONGEST", 3)  # no more are lived, and it is as late for all that
    assert estimator.missed(brief, state, Gap(np.array(7), FLOWN, FLOWN)).now == deaf.now
