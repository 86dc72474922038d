"""Each model of the medium against its closed form, by hand, by counting every case, or by another library."""

import subprocess
import sys
from itertools import pairwise, product

import numpy as np
import pytest
from paths import BENCH
from scipy import stats
from scipy.special import ndtr

from netem.core.links import Links
from netem.impairments import corrupt, delay, loss, schedule
from netem.impairments.chain import Chain, ChainLayer, all_together, steady
from netem.impairments.corrupt import Mark
from netem.impairments.delay import MessageDelay
from netem.impairments.jamming import Zone
from netem.impairments.rate import Rate
from netem.impairments.reach import Reach, ReachLaw, squared_distances
from netem.impairments.schedule import Schedule
from netem.impairments.trace import Trace

WHEEL = Links.both_ways(6, [(1, 2), (2, 3), (3, 4), (4, 5), (5, 1), *((6, n) for n in range(1, 6))])
ALL = np.ones(len(WHEEL), dtype=bool)

GEMODEL = loss.gilbert_elliott(0.01, 0.10, 0.70, 0.001)
CHAINS = {
    "bernoulli": loss.bernoulli(0.3),
    "gilbert": loss.gilbert_elliott(0.1, 0.4),
    "gemodel": GEMODEL,
    "loses in both states": loss.gilbert_elliott(0.2, 0.3, 0.9, 0.1, extra_delay=0.02),
    "markov": loss.markov(0.05, 0.30, 0.20, 0.40, 0.01),
    "bursts": loss.bursts(0.2, [0.5, 0.2, 0.3]),
    "turning": schedule.turning(5, 2),
    "two layers": loss.gilbert_elliott(0.1, 0.4).together(loss.markov(0.1, 0.5, 0.1, 0.3, 0.05)),
}
each_chain = pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)


# ---- chains


@each_chain
def test_the_stationary_distribution_is_the_one_that_a_step_leaves_alone(chain):
    assert chain.stationary.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(chain.stationary @ chain.transition, chain.stationary, atol=1e-12)
    assert chain.mean_loss == pytest.approx(chain.stationary @ chain.loss)


def chance(chain, pattern):
    """Probability of a pattern of losses: the sum over all ways through the states."""
    whole = 0.0
    for path in product(range(len(chain.loss)), repeat=len(pattern)):
        way = chain.stationary[path[0]]
        for here, there in pairwise(path):
            way *= chain.transition[here, there]
        for state, lost in zip(path, pattern, strict=True):
            way *= chain.loss[state] if lost else 1.0 - chain.loss[state]
        whole += way
    return whole


@pytest.mark.parametrize("name", ["bernoulli", "gilbert", "loses in both states", "markov", "bursts"])
def test_burst_lengths_are_those_of_counting_every_way_through_the_states(name):
    chain = CHAINS[name]
    begins = chance(chain, [0, 1])
    counted = [chance(chain, [0] + [1] * n + [0]) / begins for n in range(1, 5)]
    np.testing.assert_allclose(chain.burst_lengths(4), counted, atol=1e-12)


@each_chain
def test_burst_lengths_add_up_to_one_and_to_the_mean_burst(chain):
    lengths = chain.burst_lengths(400)
    assert (lengths >= -1e-15).all()
    assert lengths.sum() == pytest.approx(1.0)
    assert lengths @ np.arange(1, 401) == pytest.approx(chain.mean_burst)


@each_chain
def test_age_burst_and_loss_are_those_of_a_plain_simulation(chain):
    walkers, steps, rng = 2000, 600, np.random.default_rng(3)
    summed = np.cumsum(chain.transition, axis=1)
    state = rng.choice(len(chain.loss), size=walkers, p=chain.stationary / chain.stationary.sum())
    lost = np.empty((steps, walkers), dtype=bool)
    for row in lost:
        row[:] = rng.random(walkers) < chain.loss[state]
        state = np.minimum((rng.random(walkers)[:, None] >= summed[state]).sum(axis=1), len(chain.loss) - 1)
    step = np.arange(steps)[:, None]
    age = (step - np.maximum.accumulate(np.where(lost, -1, step), axis=0))[200:].mean(axis=0)
    begins = (~lost[:-1] & lost[1:]).mean(axis=0)
    for what, closed_form in (
        (lost.mean(axis=0), chain.mean_loss),
        (age, chain.mean_age),
        (lost.mean(axis=0) - chain.mean_burst * begins, 0.0),
    ):
        error = max(what.std(ddof=1) / walkers**0.5, 5e-4)  # a chain without chance is cut at the ends of the window
        assert abs(what.mean() - closed_form) < 4 * error


@pytest.mark.parametrize("p", [0.0, 0.2, 0.9])
def test_bernoulli_in_closed_form(p):
    chain = loss.bernoulli(p)
    assert chain.mean_loss == p
    assert chain.mean_age == pytest.approx(p / (1 - p))
    if p:
        assert chain.mean_burst == pytest.approx(1 / (1 - p))
        np.testing.assert_allclose(chain.burst_lengths(5), (1 - p) * p ** np.arange(5))


def test_gilbert_in_closed_form():
    chain = loss.gilbert_elliott(0.1, 0.4)
    np.testing.assert_allclose(chain.stationary, [0.8, 0.2])
    assert chain.mean_loss == pytest.approx(0.1 / 0.5)
    assert chain.mean_burst == pytest.approx(1 / 0.4)
    assert chain.mean_age == pytest.approx(0.2 / 0.4)
    np.testing.assert_allclose(chain.burst_lengths(6), 0.4 * 0.6 ** np.arange(6))


@pytest.mark.parametrize(
    ("p", "r", "bad", "good"), [(0.01, 0.1, 0.7, 0.001), (0.3, 0.2, 0.9, 0.1), (1.0, 1.0, 1.0, 0.5)]
)
def test_gilbert_elliott_loses_p_bad_plus_r_good_over_p_plus_r(p, r, bad, good):
    assert loss.gilbert_elliott(p, r, bad, good).mean_loss == pytest.approx((p * bad + r * good) / (p + r))


def test_netems_gemodel_loses_6_45_percent():
    assert pytest.approx(0.0645, abs=5e-5) == GEMODEL.mean_loss


def test_the_four_state_model_spends_its_time_as_its_balance_says():
    p13, p31, p32, p23, p14 = 0.05, 0.30, 0.20, 0.40, 0.01
    # By hand, with pi_1 as the unit: 4 is entered and left at once; 2 and 3 balance.
    three = p13 / p31
    weights = np.array([1.0, p32 / p23 * three, three, p14])
    chain = loss.markov(p13, p31, p32, p23, p14)
    np.testing.assert_allclose(chain.stationary, weights / weights.sum())
    assert chain.mean_loss == pytest.approx((three + p14) / weights.sum())


def test_losses_alone_come_one_at_a_time():
    chain = loss.markov(0.0, 1.0, 0.0, 1.0, 0.25)
    assert chain.mean_loss == pytest.approx(0.25 / 1.25)
    assert chain.mean_burst == pytest.approx(1.0)
    np.testing.assert_allclose(chain.burst_lengths(3), [1, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("mean", "lengths"), [(0.2, [0.5, 0.2, 0.3]), (0.1, [0.0, 0.0, 1.0]), (0.5, [1.0]), (0.0, [1.0])]
)
def test_bursts_have_the_loss_and_the_lengths_that_were_asked_for(mean, lengths):
    chain = loss.bursts(mean, lengths)
    assert chain.mean_loss == pytest.approx(mean)
    if mean:
        np.testing.assert_allclose(chain.burst_lengths(len(lengths) + 1), [*lengths, 0.0], atol=1e-12)
        assert chain.mean_burst == pytest.approx(np.dot(lengths, np.arange(1, len(lengths) + 1)))


def test_a_link_that_turns_is_closed_for_the_rest_of_its_period():
    chain = schedule.turning(5, 2)
    assert chain.mean_loss == pytest.approx(3 / 5)
    assert chain.mean_burst == pytest.approx(3.0)
    assert chain.mean_age == pytest.approx((1 + 2 + 3) / 5)
    np.testing.assert_allclose(chain.burst_lengths(4), [0, 0, 1, 0], atol=1e-12)


def test_a_link_that_never_loses_has_no_bursts_and_no_age():
    for chain in (steady(), schedule.turning(4, 4)):
        assert chain.mean_loss == chain.mean_age == 0.0
        assert np.isnan(chain.mean_burst)


def test_a_link_that_always_loses_has_one_burst_without_end():
    for chain in (steady(1.0), schedule.turning(4, 0), loss.gilbert_elliott(0.5, 0.0)):
        assert chain.mean_loss == pytest.approx(1.0)
        assert chain.mean_burst == chain.mean_age == float("inf")


def test_two_chains_together_pass_what_both_let_pass():
    a, b = CHAINS["loses in both states"], CHAINS["markov"]
    both = a.together(b)
    assert 1.0 - both.mean_loss == pytest.approx((1.0 - a.mean_loss) * (1.0 - b.mean_loss))
    for pattern in ([0], [1, 1], [0, 1], [1, 0, 1]):
        either = sum(
            chance(a, first) * chance(b, second)
            for first in product([0, 1], repeat=len(pattern))
            for second in product([0, 1], repeat=len(pattern))
            if list(np.maximum(first, second)) == pattern
        )
        assert chance(both, pattern) == pytest.approx(either)


def test_independent_losses_together_are_independent_losses():
    both = loss.bernoulli(0.2).together(loss.bernoulli(0.3))
    np.testing.assert_allclose(both.burst_lengths(5), loss.bernoulli(0.44).burst_lengths(5))
    assert both.mean_age == pytest.approx(0.44 / 0.56)


def test_extra_delays_add_and_count_for_messages_that_pass():
    wet = loss.gilbert_elliott(0.2, 0.3, bad=0.5, good=0.0, extra_delay=0.02)
    assert wet.mean_extra_delay == pytest.approx(0.02 * 0.4 * 0.5 / (0.6 + 0.4 * 0.5))
    assert wet.together(wet).mean_extra_delay == pytest.approx(2 * wet.mean_extra_delay)
    assert np.isnan(steady(1.0).mean_extra_delay)


def test_no_chains_together_never_lose():
    assert all_together([]).mean_loss == 0.0
    assert all_together([loss.bernoulli(0.5)] * 3).mean_loss == pytest.approx(7 / 8)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Chain(np.array([[0.5, 0.4], [0.5, 0.5]]), np.zeros(2), np.zeros(2)), "add up to 1"),
        (lambda: Chain(np.array([[1.5, -0.5], [0.5, 0.5]]), np.zeros(2), np.zeros(2)), "transition probabilities"),
        (lambda: steady(1.1), r"lie in \[0, 1\]"),
        (lambda: loss.bernoulli(-0.1), r"lie in \[0, 1\]"),
        (lambda: loss.gilbert_elliott(0.0, 0.0), "never change"),
        (lambda: loss.gilbert_elliott(0.1, 1.5), "transition probabilities"),
        (lambda: loss.gilbert_elliott(0.1, 0.5, bad=1.5), r"lie in \[0, 1\]"),
        (lambda: loss.markov(0.8, 0.1, 0.1, 0.1, 0.3), r"p13 \+ p14 is 1\.1"),
        (lambda: loss.markov(0.1, 0.8, 0.3, 0.1, 0.1), r"p31 \+ p32 is 1\.1"),
        (lambda: loss.bursts(0.1, []), "add up to 1"),
        (lambda: loss.bursts(0.1, [0.5, 0.4]), "add up to 1"),
        (lambda: loss.bursts(0.1, [1.5, -0.5]), "add up to 1"),
        (lambda: loss.bursts(0.6, [1.0]), "at most 0.5"),
        (lambda: loss.bursts(-0.1, [1.0]), "at most 0.5"),
    ],
)
def test_what_is_no_chain_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_a_layer_gives_every_link_its_own_chain():
    chains = [steady(), loss.gilbert_elliott(0.25, 0.5, 1.0, 0.0, 0.03), CHAINS["markov"]]
    layer = ChainLayer.of(0, chains, np.zeros(3, dtype=bool), sensing=True, comms=True)
    low, high = np.full(3, 1e-12), np.full(3, 1.0 - 1e-12)
    assert layer.begin(low).tolist() == [0, 0, 0]
    assert layer.begin(high).tolist() == [0, 1, 3]
    for state, draw, following in (
        ([0, 0, 0], 0.74, [0, 0, 0]),
        ([0, 0, 0], 0.76, [0, 1, 0]),
        ([0, 1, 3], 0.49, [0, 0, 0]),
        ([0, 1, 3], high[0], [0, 1, 0]),
    ):
        during, after = layer.walk(np.array(state), np.full((1, 3), draw))
        assert (during.tolist(), after.tolist()) == ([state], following)
    assert layer.lost(np.array([0, 1, 2]), high).tolist() == [False, True, True]
    assert layer.adds(np.array([0, 1, 2])).tolist() == [0.0, 0.03, 0.0]


def test_a_walk_is_its_steps_one_after_the_other():
    layer = ChainLayer.of(0, list(CHAINS.values()), np.zeros(len(CHAINS), dtype=bool), sensing=True, comms=True)
    draws = np.random.default_rng(5).random((50, 2, len(CHAINS)))
    first = layer.begin(np.full((2, len(CHAINS)), 0.5))
    states, last = layer.walk(first, draws)
    state = first
    for during, draw in zip(states, draws, strict=True):
        assert (during == state).all()
        _, state = layer.walk(state, draw[None])
    assert (last == state).all()
    assert (states < [len(chain.loss) for chain in CHAINS.values()]).all()


# ---- delays


def law(kind, mean=0.03, jitter=0.0, table=(), correlation=0.0):
    return MessageDelay(kind, ALL, mean, jitter, np.array(table), correlation, False)


SKEWED = [0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.007, 0.008, 0.054, 1.0]  # seconds; their mean is .109

DELAYS = {
    "constant": law(delay.DelayLaw.CONSTANT),
    "uniform": law(delay.DelayLaw.UNIFORM, jitter=0.02),
    "uniform, clipped": law(delay.DelayLaw.UNIFORM, mean=0.01, jitter=0.03),
    "normal": law(delay.DelayLaw.NORMAL, jitter=0.005),
    "normal, clipped": law(delay.DelayLaw.NORMAL, mean=0.01, jitter=0.02),
    "normal without jitter": law(delay.DelayLaw.NORMAL),
    "exponential": law(delay.DelayLaw.EXPONENTIAL),
    "pareto": law(delay.DelayLaw.PARETO, jitter=0.01),
    "table": law(delay.DelayLaw.TABLE, mean=0.0, table=[0.001, 0.004, 0.005, 0.1]),
}


@pytest.mark.parametrize("one", DELAYS.values(), ids=DELAYS)
def test_the_mean_of_the_quantiles_is_the_mean_delay(one):
    share = (np.arange(1_000_000) + 0.5) / 1_000_000
    seconds = one.quantile(share)
    assert seconds.mean() == pytest.approx(one.mean_delay, rel=2e-4)
    assert (seconds >= 0.0).all()
    assert (np.diff(seconds) >= 0.0).all()


U = np.linspace(0.001, 0.999, 999)


@pytest.mark.parametrize(
    ("name", "right"),
    [
        ("uniform", stats.uniform(0.01, 0.04)),
        ("normal", stats.norm(0.03, 0.005)),
        ("exponential", stats.expon(scale=0.03)),
        ("uniform, clipped", stats.uniform(-0.02, 0.06)),
        ("normal, clipped", stats.norm(0.01, 0.02)),
    ],
)
def test_quantiles_are_those_of_the_distribution(name, right):
    np.testing.assert_allclose(DELAYS[name].quantile(U), np.maximum(right.ppf(U), 0.0), atol=1e-12)


@pytest.mark.parametrize(("mean", "jitter"), [(0.03, 0.01), (0.03, 0.06), (0.5, 0.001)])
def test_a_pareto_delay_has_its_mean_and_its_standard_deviation(mean, jitter):
    share = 1.0 - 1.0 / 1.5
    # Of a Pareto distribution, two quantiles say which it is.
    first, second = law(delay.DelayLaw.PARETO, mean, jitter).quantile(np.array([1e-12, share]))
    shape = np.log(1.5) / np.log(second / first)
    right = stats.pareto(shape, scale=first)
    assert right.mean() == pytest.approx(mean, rel=1e-4)
    assert right.std() == pytest.approx(jitter, rel=1e-2)
    np.testing.assert_allclose(law(delay.DelayLaw.PARETO, mean, jitter).quantile(U), right.ppf(U), rtol=1e-6)


def test_a_table_gives_each_of_its_values_as_often_and_no_other():
    one = law(delay.DelayLaw.TABLE, table=SKEWED)
    drawn, often = np.unique(one.quantile((np.arange(100_000) + 0.5) / 100_000), return_counts=True)
    assert drawn.tolist() == SKEWED
    assert often.tolist() == [10_000] * len(SKEWED)
    assert one.mean_delay == pytest.approx(np.mean(SKEWED)) == pytest.approx(0.109)
    assert one.quantile(np.array([0.0, 1.0])).tolist() == [SKEWED[0], SKEWED[-1]]  # a copula rounds up to 1


@pytest.mark.parametrize("dt", [0.01, 0.002, 1 / 30, 0.1, 0.3])
def test_a_delay_of_whole_ticks_takes_exactly_those(dt):
    n = np.arange(2000)
    for seconds in (n * dt, np.cumsum(np.full(2000, dt)) - dt):
        assert (delay.ticks(seconds, dt) == n).all()
    assert (delay.ticks((n + 0.001) * dt, dt) == n + 1).all()
    assert (delay.ticks((n + 0.999) * dt, dt) == n + 1).all()


def test_correlated_numbers_stay_standard_normal():
    rng = np.random.default_rng(1)
    before, fresh = rng.standard_normal((2, 200_000))
    after = delay.correlated(before, fresh, 0.8)
    assert np.mean(before * after) == pytest.approx(0.8, abs=0.01)
    assert after.var() == pytest.approx(1.0, abs=0.015)
    assert (delay.correlated(before, fresh, 0.0) == fresh).all()


# ---- limited rate


def bucket(rate=1000.0, burst=0.0, queue=300.0):
    return Rate(np.array([rate]), np.array([burst]), np.array([queue]))


def admitted(limit, debt, *bits, offered=True):
    """The debt, and for a message of each size whether it overflowed, and its wait."""
    debt, overflow, wait = limit.admit(np.array([debt]), np.array(bits), np.full((len(bits), 1), offered))
    return debt.item(), overflow[:, 0].tolist(), wait[:, 0].tolist()


def test_a_message_waits_for_itself_and_for_those_before_it():
    assert admitted(bucket(), 0.0, 100.0, 50.0) == (150.0, [False, False], [0.1, 0.15])
    assert admitted(bucket(), 150.0, 100.0) == (250.0, [False], [0.25])


def test_tokens_let_a_burst_pass_at_once():
    limit = bucket(burst=250.0)
    _, overflow, waits = admitted(limit, limit.begin().item(), *[100.0] * 4)
    assert not any(overflow)
    assert waits == pytest.approx([0.0, 0.0, 0.05, 0.15])


def test_a_full_queue_refuses_and_forgets_what_it_refused():
    assert admitted(bucket(), 250.0, 100.0)[:2] == (250.0, [True])
    debt, overflow, wait = admitted(bucket(), 250.0, 100.0, 50.0)  # the second fills it to the brim
    assert (debt, overflow, wait[1]) == (300.0, [True, False], 0.3)


def test_the_queues_of_links_know_nothing_of_each_other():
    limit = Rate(np.array([1000.0, 10.0, np.inf]), np.zeros(3), np.array([150.0, 150.0, np.inf]))
    offered = np.array([[True, True, True], [True, False, True]])
    debt, overflow, wait = limit.admit(np.zeros(3), np.array([100.0, 100.0]), offered)
    assert overflow.tolist() == [[False, False, False], [True, False, False]]
    assert debt[:2].tolist() == [100.0, 100.0]
    assert wait[0].tolist() == [0.1, 10.0, 0.0]
    assert wait[1, 2] == 0.0


def test_rest_pays_the_debt_and_fills_the_bucket_no_further_than_its_size():
    limit = bucket(burst=100.0)
    assert limit.rest(np.array([250.0]), 0.1) == 150.0
    assert limit.rest(np.array([250.0]), 0.3) == -50.0
    assert limit.rest(np.array([250.0]), 9.0) == -100.0 == limit.begin()


def test_a_link_without_a_limit_never_waits_nor_refuses():
    limit = bucket(rate=np.inf, queue=np.inf)
    debt, overflow, wait = admitted(limit, limit.begin().item(), 1e9)
    assert (overflow, wait) == ([False], [0.0])
    assert limit.rest(np.array([debt]), 0.01) == limit.begin()


def test_what_is_not_offered_costs_nothing():
    assert admitted(bucket(), 299.0, 100.0, offered=False)[:2] == (299.0, [False])


@pytest.mark.parametrize(("rate", "bits"), [(1000.0, 100.0), (777.0, 50.0), (5000.0, 60.0)])
def test_a_saturated_queue_lets_through_what_its_rate_says(rate, bits):
    limit, dt, ticks = bucket(rate=rate, burst=200.0), 0.01, 5000
    debt, passed, last = limit.begin(), 0, 0.0
    for tick in range(ticks):
        debt = limit.rest(debt, dt) if tick else debt
        debt, (overflow,), (wait,) = admitted(limit, debt.item(), bits)
        debt = np.array([debt])
        if not overflow:
            passed += 1
            assert tick * dt + wait >= last - 1e-9  # in order
            last = tick * dt + wait
    assert passed * bits == pytest.approx(rate * (ticks - 1) * dt + 200.0 + 300.0, abs=bits)


# ---- corruption


CHANCES = np.array([[0.1, 0.2, 0.3, 0.25]])


def test_kinds_exclude_each_other_and_have_their_shares():
    draw = (np.arange(10_000) + 0.5) / 10_000
    kinds = corrupt.marks(CHANCES, draw[:, None])[:, 0]
    assert np.bincount(kinds, minlength=5).tolist() == [1500, 1000, 2000, 3000, 2500]


def test_without_chances_nothing_is_corrupted():
    assert not corrupt.marks(np.zeros((3, 4)), np.full((2, 3), 1e-9)).any()
    assert (corrupt.marks(np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)), np.full((2, 3), 0.999)) == Mark.BIT_FLIP).all()


def arriving(kind, numbers, bias=0.0, draw=(0.5, 0.5)):
    sent = np.array([numbers], dtype=np.float64)
    return corrupt.corrupted(sent, np.array([kind], dtype=np.uint8), np.array([bias]), np.array([draw]))[0]


@pytest.mark.parametrize("kind", [Mark.NONE, Mark.STALE])
def test_what_is_not_corrupted_in_its_numbers_arrives_as_sent(kind):
    assert arriving(kind, [1.0, np.inf, -3.5], bias=7.0).tolist() == [1.0, np.inf, -3.5]


def test_a_bias_and_nan_strike_every_number():
    assert arriving(Mark.BIAS, [1.0, -2.0], bias=0.5).tolist() == [1.5, -1.5]
    assert np.isnan(arriving(Mark.NAN, [1.0, -2.0])).all()


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("bit", [0, 1, 31, 51, 52, 62, 63])
def test_a_bit_flip_flips_exactly_that_bit_of_that_number(place, bit):
    sent = np.array([1.5, -2.25, 1e300])
    got = arriving(Mark.BIT_FLIP, sent, draw=((place + 0.5) / 3, (bit + 0.5) / 64))
    changed = sent.view(np.uint64) ^ got.view(np.uint64)
    assert changed.tolist() == [2**bit if n == place else 0 for n in range(3)]


def test_each_message_is_corrupted_in_its_own_way():
    sent = np.arange(12.0).reshape(4, 3)
    kinds = np.array([Mark.BIT_FLIP, Mark.NONE, Mark.NAN, Mark.BIT_FLIP], dtype=np.uint8)
    draw = np.array([[0.9, 0.999], [0.0, 0.0], [0.0, 0.0], [0.1, 0.999]])
    got = corrupt.corrupted(sent, kinds, np.zeros(4), draw)
    np.testing.assert_array_equal(got, [[0, 1, -2], [3, 4, 5], [np.nan] * 3, [-9, 10, 11]])
    assert sent.tolist() == np.arange(12.0).reshape(4, 3).tolist()


def test_a_message_without_numbers_cannot_be_corrupted():
    assert corrupt.corrupted(np.empty((1, 0)), np.array([4], np.uint8), np.zeros(1), np.zeros((1, 2))).shape == (1, 0)
    fields = {"started": np.array([True])}
    assert corrupt.corrupted_fields(fields, np.array([3], np.uint8), np.ones(1), np.zeros((1, 2))) == fields


def test_truths_and_whole_numbers_are_left_alone_and_fields_keep_their_shapes():
    fields = {
        "theta": np.arange(8.0).reshape(2, 2, 2),
        "started": np.array([True, False]),
        "count": np.array([5, 6]),
        "angle": np.array([0.5, 0.25]),
    }
    kinds = np.array([Mark.NAN, Mark.BIT_FLIP], dtype=np.uint8)
    # The angle comes first by name: the first fifth of the draw strikes it, and bit 63 is the sign.
    got = corrupt.corrupted_fields(fields, kinds, np.zeros(2), np.array([[0.0, 0.0], [0.1, 0.999]]))
    assert got["started"] is fields["started"]
    assert got["count"] is fields["count"]
    np.testing.assert_array_equal(got["angle"], [np.nan, -0.25])
    np.testing.assert_array_equal(got["theta"], [np.full((2, 2), np.nan), fields["theta"][1]])


def test_kinds_are_named_as_in_scenarios():
    assert [kind.label for kind in Mark] == ["none", "stale", "bias", "nan", "bit-flip"]


# ---- traces


def test_a_message_passes_with_the_availability_of_its_tick():
    one = Trace(np.array([0, 3]), np.array([[0.5, 1.0], [0.25, 0.0]]), True, True)
    lost = one.lost(np.array([0, 2, 3, 100]), np.full((4, 1, 2), 0.4))
    assert lost[:, 0].tolist() == [[False, False], [False, False], [True, True], [True, True]]


# ---- place


def reaching(kind, inner=0.0, outer=20.0, shadowing=0.0, rows=(True,)):
    return Reach(kind, np.array(rows), inner, outer, 3.0, shadowing, 1, True, True)


EVENLY = ((np.arange(100_000) + 0.5) / 100_000)[:, None]


@pytest.mark.parametrize(("metres", "availability"), [(0, 1), (10, 1), (12.5, 0.75), (19, 0.1), (20, 0), (30, 0)])
def test_a_ramp_falls_straight(metres, availability):
    passing = metres <= reaching(ReachLaw.RAMP, inner=10.0).limit(EVENLY, np.zeros(1))
    assert passing.mean() == pytest.approx(availability, abs=1e-5)


def test_a_disk_passes_all_up_to_its_edge():
    assert (reaching(ReachLaw.RAMP, inner=20.0).limit(EVENLY, np.zeros(1)) == 20.0).all()


@pytest.mark.parametrize("metres", [5.0, 15.0, 20.0, 30.0])
def test_half_of_the_shadows_pass_at_the_range_and_the_others_by_the_normal_law(metres):
    passing = metres <= reaching(ReachLaw.LOG_DISTANCE, shadowing=4.0).limit(np.zeros(1), stats.norm.ppf(EVENLY))
    assert passing.mean() == pytest.approx(ndtr(10 * 3.0 * np.log10(20.0 / metres) / 4.0), abs=2e-5)


def test_without_shadows_the_log_distance_law_is_a_disk():
    assert (reaching(ReachLaw.LOG_DISTANCE).limit(np.zeros(1), stats.norm.ppf(EVENLY)) == 20.0).all()


@pytest.mark.parametrize("kind", ReachLaw)
def test_a_reach_acts_on_its_own_links_alone(kind):
    reach = reaching(kind, 1.0, 1.0, rows=(True, False))
    assert reach.limit(np.full(2, 0.5), np.zeros(2)).tolist() == [1.0, np.inf]


def test_the_distance_of_a_link_is_that_of_its_ends():
    position = np.random.default_rng(0).normal(size=(4, 6, 3))
    squared = squared_distances(WHEEL.src - 1, WHEEL.dst - 1, position)
    for (src, dst), row in WHEEL.index.items():
        apart = np.linalg.norm(position[:, src - 1] - position[:, dst - 1], axis=-1)
        np.testing.assert_allclose(squared[:, row], apart**2)


def test_a_jammer_silences_whoever_listens_inside():
    zone = Zone(np.array([0.0, 0.0]), 2.0, 0.4, ALL, True, True)
    position = np.array([[0, 0], [2, 0], [2.001, 0], [9, 9], [0, -2], [-3, 0]], dtype=float)
    assert (zone.jammed(WHEEL.dst - 1, position) == np.isin(WHEEL.dst, [1, 2, 5])).all()


def test_a_jammer_strikes_only_the_links_it_can():
    rows = WHEEL.src == 6
    zone = Zone(np.array([0.0, 0.0]), 1e9, 1.0, rows, True, True)
    assert (zone.jammed(WHEEL.dst - 1, np.zeros((6, 2))) == rows).all()


# ---- turns


def opened(turns, ticks):
    return ~Schedule(*turns, True, True).closed(np.arange(ticks))


@pytest.mark.parametrize("held", [1, 3])
def test_in_a_round_robin_every_agent_hears_exactly_one_neighbour_a_tick_and_each_in_turn(held):
    turns = opened(schedule.round_robin(WHEEL, held), 60 * held)
    for agent in range(1, 7):
        own = WHEEL.dst == agent
        heard = turns[:, own]
        assert (heard.sum(axis=1) == 1).all()
        in_turn = np.repeat(np.arange(60), held) % own.sum()
        assert (heard.argmax(axis=1) == in_turn).all()


@pytest.mark.parametrize("held", [1, 2])
def test_in_slots_exactly_one_agent_speaks_at_a_time(held):
    turns = opened(schedule.slotted(WHEEL, held), 24)
    for tick, heard in enumerate(turns):
        assert (heard == (WHEEL.src == (tick // held) % 6 + 1)).all()


def test_a_turning_link_is_open_as_its_chain_is():
    size = np.ones(len(WHEEL), dtype=np.int64)
    turns = opened((7 * size, 0 * size, 3 * size), 70)
    assert (turns == (np.arange(70)[:, None] % 7 < 3)).all()
    assert 1.0 - turns.mean() == pytest.approx(schedule.turning(7, 3).mean_loss)


def test_a_period_of_one_is_always_open():
    size = np.ones(len(WHEEL), dtype=np.int64)
    assert opened((size, 0 * size, size), 10).all()


# ---- through the medium, by the bench


def accuracy(*options):
    bench = BENCH / "accuracy.py"
    return subprocess.run([sys.executable, str(bench), *options], capture_output=True, text=True, check=False)


def test_chains_through_the_medium_keep_their_closed_forms():
    done = accuracy("--verdicts", "20000", "--only", "loss")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("| ok |") > 60


@pytest.mark.slow
def test_a_million_verdicts_of_every_model_keep_their_closed_forms():
    done = accuracy("--only", "loss,delay,place,independence,composed")
    assert done.returncode == 0, done.stdout + done.stderr
