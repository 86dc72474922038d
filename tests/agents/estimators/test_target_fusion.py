"""What agents make of what others found of a target: by consensus, and by the mean of what is heard."""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest
from briefs import brief
from targets import SMOOTH, Textbook, agreed, target_of, watch

from agents.brief import Own
from agents.estimators.target import TargetEstimator
from agents.exchange import Heard
from analysis.models.information import unpacked
from analysis.models.pursuit import Sighting
from netem.core.channels import TARGET


@pytest.mark.parametrize("fusion", ["redcho", "mean"])
def test_who_hears_nobody_goes_by_its_own_information(fusion):
    alone = replace(brief(np.zeros((1, 1, 2))), dt=0.05, target=target_of())
    assert not alone.present.any()
    together = TargetEstimator(fusion=fusion)
    flown, by_itself = (list(watch(estimator, target_of(), ticks=60)) for estimator in (together, SMOOTH))
    for one, other in zip(flown, by_itself, strict=True):
        for name in ("reference", "found", "variance", "information", "fused"):
            np.testing.assert_allclose(one.estimate.reports[name], other.estimate.reports[name], rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(other.estimate.reports["fused"], other.estimate.reports["information"])


def test_what_is_told_is_the_information_with_the_derivatives_that_are_wanted():
    told = replace(brief(np.ones((2, 2))), target=target_of(3))
    assert TargetEstimator().channels(told)[TARGET]["information"].shape == (6 + 3 * 2,)
    assert TargetEstimator(fusion="mean").channels(told)[TARGET]["information"].shape == (4, 6 + 3 * 2)
    assert SMOOTH.channels(told) == {}


def around(function, at, orders, radius=0.02, points=16):
    """Value and derivatives of a function of time that is real where time is, by Cauchy's formula on half a circle."""
    turns = np.exp(2j * np.pi * np.arange(points // 2 + 1) / points)
    series = np.fft.hfft([function(at + radius * turn) for turn in turns], points, axis=0) / points
    return [factorial(order) * series[order] / radius**order for order in range(orders)]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_with_the_mean_come_the_derivatives_of_the_position_that_it_stands_for(order):
    dt, latencies = 0.05, (14, 8)
    flown = agreed(2.0, dt, latencies, order, fusion="mean")
    books = [Textbook([one[2] for one in flown], target_of(order, latencies), dt, agent) for agent in range(3)]
    assert min(len(book.times) for book in books) > 2
    for tick in range(1, 40, 5):
        latest = [book.latest(tick * dt) for book in books]

        def place(seconds, latest=latest):
            Q, y = zip(*(book.smooth(seconds, 1.0, k) for book, k in zip(books, latest, strict=True)), strict=True)
            return np.linalg.solve(sum(Q), sum(y))[0]

        expected = around(place, tick * dt, order + 1)
        for found in flown[tick][1].reports["reference"]:
            for mine, theirs in zip(found, expected, strict=True):
                np.testing.assert_allclose(mine, theirs, rtol=1e-6, atol=1e-6 * np.abs(theirs).max())


def hearing(estimator, state, shares, fresh, tick=0):
    """A tick of three agents without a detection, in which neighbours say these multiples of what it says itself."""
    agents, nothing = replace(brief(np.ones((3, 2, 2))), target=target_of()), np.zeros((3, 2))
    state, said = estimator.sense(agents, state or estimator.init(agents, (3,)), agents.relative, agents.present)
    mine = said[TARGET]["information"]
    theirs = np.multiply.outer(np.array(shares), np.ones(mine.shape[1:])) * mine[:, None]
    idle = Sighting(nothing, np.zeros(3, dtype=bool), state.method, state.method)
    heard = {TARGET: Heard({"information": theirs}, np.array(fresh))}
    state, estimate = estimator.fuse(agents, state, heard, Own(nothing, nothing, tick, sighting=idle))
    return state, estimate.reports, mine


PARTLY = [[True, False], [False, False], [True, True]]


def test_what_was_lost_counts_for_nothing_in_the_mean_whatever_stands_in_its_place():
    nan = np.nan
    _, said, mine = hearing(TargetEstimator(fusion="mean"), None, [[2.0, nan], [nan, -7.0], [3.0, 4.0]], PARTLY)
    # (1 + 2) / 2 and (1 + 3 + 4) / 3 of what all know alike in the first tick.
    assert np.abs(mine).max() > 0.1
    np.testing.assert_allclose(said["fused"], np.array([1.5, 1.0, 8 / 3])[:, None, None] * mine, rtol=1e-12)


def test_what_was_lost_counts_in_redcho_as_what_was_said_last_and_before_that_for_nothing():
    redcho, nan, all_heard = TargetEstimator(theta=2.0), np.nan, np.ones((3, 2), dtype=bool)
    once, *_ = hearing(redcho, None, [[2.0, nan], [nan, nan], [3.0, 4.0]], PARTLY)
    silent, *_ = hearing(redcho, None, [[2.0, 1.0], [1.0, 1.0], [3.0, 4.0]], all_heard)
    np.testing.assert_array_equal(once.internal, silent.internal)
    assert (np.abs(once.internal).max(axis=(1, 2)) > 1e-3).tolist() == [True, False, True]
    held, _, mine = hearing(redcho, once, np.full((3, 2), nan), ~all_heard, tick=1)
    last = np.where(np.array(PARTLY)[..., None], once.theirs, mine[:, None])
    agents = replace(brief(np.ones((3, 2, 2))), target=target_of())
    expected = redcho._consensus.step(once.internal, mine, last, agents.dt)
    np.testing.assert_allclose(held.internal, expected, rtol=1e-12, atol=1e-12)
    assert np.abs(held.internal - once.internal).max() > 1e-3


@pytest.mark.parametrize("hold", [0, 1, 3])
def test_what_was_said_last_counts_in_redcho_for_as_many_ticks_as_it_is_held_and_then_as_ones_own(hold):
    redcho, nobody = TargetEstimator(theta=2.0, hold=hold), np.zeros((3, 2), dtype=bool)
    agents = replace(brief(np.ones((3, 2, 2))), target=target_of())
    shares = [[2.0, 5.0], [3.0, 0.5], [3.0, 4.0]]
    state, _, mine = hearing(redcho, None, shares, PARTLY)
    said, heard = np.multiply.outer(np.array(shares), np.ones(7)) * mine[:, None], np.array(PARTLY)[..., None]
    for silent in range(1, 6):
        before = state
        state, _, mine = hearing(redcho, state, np.full((3, 2), np.nan), nobody, tick=silent)
        counted = np.where(heard & (silent <= hold), said, mine[:, None])
        expected = redcho._consensus.step(before.internal, mine, counted, agents.dt)
        np.testing.assert_allclose(state.internal, expected, rtol=1e-12, atol=1e-12)
        # Of those whom it has never heard, an agent holds nothing.
        pulled = np.abs(counted - mine[:, None]).max(axis=(1, 2)) > 1e-3
        assert pulled.tolist() == [silent <= hold, False, silent <= hold]
    # Who is heard again counts again, and is held again.
    again, *_ = hearing(redcho, state, shares, PARTLY, tick=6)
    after, _, mine = hearing(redcho, again, np.full((3, 2), np.nan), nobody, tick=7)
    alone = redcho._consensus.step(again.internal, mine, mine[:, None], agents.dt)
    assert (np.abs(after.internal - alone).max(axis=(1, 2)) > 1e-3).tolist() == [hold > 0, False, hold > 0]


def test_when_nothing_is_held_only_who_is_heard_in_the_tick_counts():
    fresh_only, held = (TargetEstimator(theta=2.0, hold=hold) for hold in (0, 10))
    for estimator in (fresh_only, held):
        once, *_ = hearing(estimator, None, [[2.0, 3.0]] * 3, np.ones((3, 2), dtype=bool))
        by_itself, *_ = hearing(estimator, None, [[1.0, 1.0]] * 3, np.ones((3, 2), dtype=bool))
        # Those who are heard in the tick pull, however long they would be held.
        assert np.abs(once.internal - by_itself.internal).max() > 1e-3
        later, *_ = hearing(estimator, once, np.full((3, 2), np.nan), np.zeros((3, 2), dtype=bool), tick=1)
        alone, *_ = hearing(estimator, once, [[1.0, 1.0]] * 3, np.ones((3, 2), dtype=bool), tick=1)
        assert np.array_equal(later.internal, alone.internal) == (estimator is fresh_only)


def test_an_agent_goes_by_its_own_information_where_what_is_agreed_on_is_next_to_none():
    # In the mean a hundredth of its own is left, and a little more or less.
    shares = np.array([-0.984, -0.976, -1.5])
    _, said, _ = hearing(TargetEstimator(fusion="mean"), None, np.stack([shares, shares], axis=1), [[True, False]] * 3)
    _, alone, _ = hearing(TargetEstimator(fusion="mean"), None, np.zeros((3, 2)), np.zeros((3, 2), dtype=bool))
    np.testing.assert_allclose(said["variance"], alone["variance"] / [1.0, 0.012, 1.0], rtol=1e-9)


def test_all_that_hear_everybody_find_the_same_with_the_mean():
    for _, estimate, *_ in agreed(2.0, 0.05, (20, 10), fusion="mean")[1:]:
        for name in ("reference", "variance", "fused"):
            first, *others = estimate.reports[name]
            for other in others:
                np.testing.assert_allclose(other, first, rtol=1e-12, atol=1e-12 * np.abs(first).max())
        Q = unpacked(estimate.reports["information"][:, 0].mean(axis=0), 2, 2)[0]
        np.testing.assert_allclose(estimate.reports["variance"], np.linalg.inv(Q)[0, 0], rtol=1e-9)


def apart(consensus):
    """How far what three agents agree on is apart, and from the mean of what they know, tick by tick."""
    fused, known = (
        np.stack([flown[1].reports[name][:, 0] for flown in consensus]) for name in ("fused", "information")
    )
    mean = known.mean(axis=1, keepdims=True)
    return np.abs(fused - fused[:, :1]).max(axis=(1, 2)), np.abs(fused - mean).max(axis=(1, 2))


def test_theorem_2_agents_that_begin_apart_agree_in_finite_time_and_then_come_to_the_mean():
    internal = np.zeros((3, 3, 7))
    internal[:, 0] = np.random.default_rng(3).normal(scale=0.05, size=(3, 7))
    first = ((1.0, -1.0), (-2.0, 0.5), (0.5, 1.5))
    begun = tuple(tuple(map(tuple, one)) for one in internal.tolist())
    consensus = agreed(1.6, latencies=(4000, 3000), first=first, internal=begun)
    np.testing.assert_allclose(consensus[0][1].reports["found"], first)
    from_each_other, from_the_mean = apart(consensus)
    assert from_each_other[0] > 1.0
    assert from_each_other[200:].max() < 1e-3 * from_each_other[0]
    # What they agree on is off by the mean of what they began with, and forgets it at the rate gamma, 1 1/s.
    assert from_the_mean[200] > 10.0 * from_each_other[200]
    assert from_the_mean[-1] == pytest.approx(np.exp(-1.4) * from_the_mean[200], rel=0.1)


def test_each_agent_begins_with_its_own_by_its_number():
    placed = replace(brief(np.ones((2, 2, 2))), target=target_of(), number=np.array([2, 1]))
    internal = np.arange(42.0).reshape(2, 3, 7)
    estimator = TargetEstimator(first=[[1.0, 2.0], [3.0, 4.0]], internal=internal.tolist())
    state = estimator.init(placed, (2,))
    np.testing.assert_array_equal(state.last.mean, [[[3, 4], [0, 0]], [[1, 2], [0, 0]]])
    np.testing.assert_array_equal(state.internal, internal[::-1])
    np.testing.assert_array_equal(estimator.init(placed.of(0), ()).internal, internal[1])
    nothing = TargetEstimator().init(placed, (2,))
    assert not nothing.internal.any()
    assert not nothing.last.mean.any()
