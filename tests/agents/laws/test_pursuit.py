"""The law that pursues a target: by hand, of any order as in the paper, and how agents move by it."""

from dataclasses import replace

import numpy as np
import pytest
from briefs import brief
from flying import plan_of
from pursuits import ALONE, NAME, bodies
from targets import ORDERS

from agents.brief import Own
from agents.estimate import Estimate
from agents.exchange import Heard
from agents.laws.pursuit import Pursuit
from analysis.models.pursuit import Sighting
from netem.core.channels import INPUT


def knows(*reference):
    nothing = np.zeros((1, 2))
    return Estimate(
        nothing,
        np.zeros(1, dtype=bool),
        np.zeros((1, 2, 2)),
        np.array(np.nan),
        reports={"reference": np.array(reference)},
    )


PLACED = replace(brief(np.ones((1, 2))), nominal=np.array([3.0, -1.0]))


def test_the_law_by_hand():
    own = Own(np.array([0.5, 0.0]), np.zeros(2), 0, np.array([10.0, 2.0]))
    reference = knows([4.0, 1.0], [1.0, 1.0], [0.1, -0.2])
    law = Pursuit(kappa=(2.0, 3.0))
    _, u = law.command(PLACED, law.init(PLACED, ()), 0, own, reference, None)
    # Off by (10, 2) - (4, 1) - (3, -1) = (3, 2), behind by (-0.5, -1).
    np.testing.assert_allclose(u, [0.1 - 2 * 3 + 3 * 0.5, -0.2 - 2 * 2 + 3 * 1], rtol=1e-12)
    first = Pursuit(kappa=[2.0])
    _, u = first.command(PLACED, first.init(PLACED, ()), 0, own, reference, None)
    np.testing.assert_allclose(u, [1 - 2 * 3, 1 - 2 * 2], rtol=1e-12)
    np.testing.assert_allclose(
        Pursuit().command(PLACED, law.init(PLACED, ()), 0, own, reference, None)[1], [0.1 - 3 + 1, -0.2 - 2 + 2]
    )


@pytest.mark.parametrize("batch", [(), (3, 5)], ids=["one", "many"])
@ORDERS
def test_the_law_of_any_order_is_that_of_the_paper(order, batch):
    rng = np.random.default_rng(order)
    p, x = rng.normal(size=(5, *batch, 2)), rng.normal(size=(4, *batch, 2))
    k = np.poly(-rng.uniform(0.5, 3.0, order))[:0:-1]
    place = k[0] * (x[0] - p[0] - PLACED.nominal)
    written_out = {  # (11)
        1: lambda: p[1] - place,
        2: lambda: p[2] - place - k[1] * (x[1] - p[1]),
        3: lambda: p[3] - place - k[1] * (x[1] - p[1]) - k[2] * (x[2] - p[2]),
        4: lambda: p[4] - place - k[1] * (x[1] - p[1]) - k[2] * (x[2] - p[2]) - k[3] * (x[3] - p[3]),
    }
    law, flying = Pursuit(kappa=k.tolist()), np.full((*batch, 2), 77.0)
    assert law.order == order
    own = Own(flying, flying, 0, x[0])
    if order > 1:
        own = own._replace(velocity=x[1], higher=np.moveaxis(x[2:order], 0, -2))
    # Those who know of more derivatives than the law wants do not disturb it.
    for known in range(order + 1, 6):
        reference = knows(*np.zeros((known, 2)))._replace(reports={"reference": np.moveaxis(p[:known], 0, -2)})
        _, u = law.command(PLACED, law.init(PLACED, batch), 0, own, reference, None)
        np.testing.assert_allclose(u, written_out[order](), rtol=1e-12, atol=1e-12)
    with pytest.raises(ValueError, match=f"derivatives up to {order}: the estimator has to report them"):
        law.command(PLACED, law.init(PLACED, batch), 0, own, knows(*np.zeros((order, 2))), None)


@pytest.mark.parametrize("kappa", [(), (1.0, 5.0, 10.0, 10.0, 5.0)], ids=["none", "five"])
def test_a_law_has_a_gain_for_each_of_one_to_four_times(kappa):
    with pytest.raises(ValueError, match=r"kappa needs a gain for each of 1 to 4 times .* like \[1.0, 2.0\]") as told:
        Pursuit(kappa=kappa)
    assert str(told.value).endswith(f"got {list(kappa)}")


@pytest.mark.parametrize(
    "kappa",
    [(0.0,), (-1.0,), (1.0, 0.0), (1.0, -2.0), (2.0, 1.0, 2.0), (2.1, 1.0, 2.0), (1.0, 1.0, 1.0, 1.0)],
    ids=str,
)
def test_gains_with_which_agents_would_leave_the_reference_are_refused(kappa):
    with pytest.raises(ValueError, match="not Hurwitz"):
        Pursuit(kappa=kappa)
    assert Pursuit(kappa=(1.9, 1.0, 2.0)).order == 3  # by Routh and Hurwitz, kappa_0 < kappa_1 kappa_2


def test_the_law_wants_a_position():
    nowhere = Own(np.zeros(2), np.zeros(2))
    for law in (Pursuit(), Pursuit(kappa=(1.0,))):
        with pytest.raises(ValueError, match="own position"):
            law.command(PLACED, law.init(PLACED, ()), 0, nowhere, knows([0, 0], [0, 0], [0, 0]), None)


@ORDERS
def test_agents_say_how_they_move_up_to_their_input_and_steer_by_it(order):
    kappa, rng = [[2.0], [2.0, 3.0], [2.0, 3.0, 5.0], [2.0, 5.0, 9.0, 7.0]][order - 1], np.random.default_rng(order)
    made = plan_of(NAME, *bodies(order, *kappa), f"target.order={order}", ALONE)
    agent, nobody = made.agents, np.zeros_like(made.brief.present)
    place, *moves = rng.normal(size=(order, 10, 2))
    motion = np.stack(moves, axis=1) if moves else None
    sighting = Sighting(rng.normal(size=(10, 2)), np.ones(10, dtype=bool), *np.zeros((2, 10), dtype=np.int64))
    state = agent.init((10,))
    for tick in range(2):
        flying = state.input
        state, said = agent.sense(state, tick, made.brief.relative, made.brief.present, motion)
        assert list(said[INPUT]) == ["velocity", "acceleration", "jerk", "snap"][:order]
        assert {name: field.shape for name, field in agent.channels()[INPUT].items()} == dict.fromkeys(
            said[INPUT], (2,)
        )
        for told, mine in zip(said[INPUT].values(), [*moves, flying], strict=True):
            np.testing.assert_array_equal(told, mine)
        heard = {INPUT: Heard({name: np.zeros((*nobody.shape, 2)) for name in said[INPUT]}, nobody)}
        state, action = agent.act(state, tick, heard, place, motion, sighting)
        p = np.moveaxis(action.estimate.reports["reference"], 1, 0)
        off = [place - p[0] - made.brief.nominal, *(mine - p[mu] for mu, mine in enumerate(moves, 1))]
        expected = p[order] - sum(gain * each for gain, each in zip(kappa, off, strict=True))
        np.testing.assert_allclose(action.input, expected, rtol=1e-12, atol=1e-12)
    assert (flying != 0.0).all()
