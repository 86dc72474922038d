"""Chains fitted to sequences: planted ones are found within their intervals, and what no chain made is refused."""

from contextlib import suppress

import numpy as np
import pytest

from affinet.traces import fitting, goodness, runs
from affinet.traces.fitting import NotFitted
from netem.impairments import loss
from netem.impairments.likelihood import log_likelihood, predicted


def planted(chain, messages, sequences, seed=1):
    """Sequences of a chain, drawn here and in another way than the medium draws them."""
    rng = np.random.default_rng(seed)
    lost = np.empty((sequences, messages), dtype=bool)
    for row in lost:
        state = rng.choice(len(chain.loss), p=chain.stationary)
        for n, (step, draw) in enumerate(rng.random((messages, 2))):
            row[n] = draw < chain.loss[state]
            state = int(
                np.searchsorted(np.cumsum(chain.transition[state]), step, side="right").clip(max=len(chain.loss) - 1)
            )
    return lost


GILBERT, ELLIOTT = loss.gilbert_elliott(0.03, 0.3), loss.gilbert_elliott(0.03, 0.15, 0.7, 0.02)
MARKOV = loss.markov(0.03, 0.2, 0.2, 0.5, 0.02)


def covered(fit, truth):
    return [fit.parameters[name].low <= value <= fit.parameters[name].high for name, value in truth.items()]


def test_the_likelihood_of_a_chain_is_the_sum_over_its_hidden_states():
    lost = np.array([True, False, True])
    step, worth = ELLIOTT.transition, np.where(lost[:, None], ELLIOTT.loss, 1.0 - ELLIOTT.loss)
    ways = np.einsum("i,i,ij,j,jk,k->", ELLIOTT.stationary, worth[0], step, worth[1], step, worth[2])
    assert log_likelihood(ELLIOTT, lost) == pytest.approx(np.log(ways), abs=1e-12)
    assert predicted(ELLIOTT, lost)[0] == pytest.approx(ELLIOTT.mean_loss)


def test_an_impossible_sequence_has_no_likelihood():
    with np.errstate(divide="ignore"):
        assert log_likelihood(loss.bernoulli(0.0), np.array([False, True])) == -np.inf


def test_intervals_of_what_is_counted_cover_the_truth_as_often_as_they_say():
    each = [covered(fitting.fitted("gilbert", [one]), {"p": 0.03, "r": 0.3}) for one in planted(GILBERT, 600, 150)]
    shares = np.mean(each, axis=0)
    assert (shares > 0.91).all()  # three standard deviations below 95 %, which they are at least
    assert (shares < 1.0).all()
    each = [covered(fitting.fitted("bernoulli", [one]), {"p": 0.1}) for one in planted(loss.bernoulli(0.1), 300, 150)]
    assert 0.91 < np.mean(each) < 1.0


@pytest.mark.parametrize(
    ("model", "chain", "truth"),
    [
        ("gilbert-elliott", ELLIOTT, {"p": 0.03, "r": 0.15, "bad": 0.7, "good": 0.02}),
        ("markov", MARKOV, {"p13": 0.03, "p31": 0.2, "p32": 0.2, "p23": 0.5, "p14": 0.02}),
    ],
)
def test_intervals_of_hidden_chains_cover_the_truth(model, chain, truth):
    (lost,) = planted(chain, 1500, 1, seed=2)
    fit = fitting.fitted(model, [lost])
    assert all(covered(fit, truth))
    assert all(one.low < one.value < one.high for one in fit.parameters.values())
    assert all(one.high - one.low < 0.6 for one in fit.parameters.values())  # and say something
    assert fit.log_likelihood >= log_likelihood(chain, lost)
    assert not goodness.of(fit.chain, [lost]).refused


@pytest.mark.parametrize(
    ("chain", "model", "parameters"),
    [(loss.bernoulli(0.2), "bernoulli", 1), (GILBERT, "gilbert-elliott", 2), (ELLIOTT, "gilbert-elliott", 4)],
)
def test_the_best_model_is_that_of_the_truth(chain, model, parameters):
    (lost,) = planted(chain, 1500, 1)
    fit, tried = fitting.best([lost])
    assert (fit.model, len(fit.parameters)) == (model, parameters)
    assert tried.keys() == {*fitting.MODELS}


def test_sequences_of_several_links_count_together_and_no_burst_goes_from_one_to_the_next():
    one = np.array([False, True, True, False, True])
    fit = fitting.fitted("gilbert", [one, ~one])
    assert fit.parameters["p"].value == 3 / 4  # of 4 that passed and had one after them, 3 were followed by a loss
    assert fit.parameters["r"].value == 3 / 4


PERIODIC = np.arange(2000) % 10 == 0
DRIFTING = np.random.default_rng(3).random(2000) < np.linspace(0.0, 0.5, 2000)


@pytest.mark.parametrize("model", ["bernoulli", "gilbert", "gilbert-elliott", "markov"])
def test_losses_at_regular_times_are_of_no_chain(model):
    found = goodness.of(fitting.fitted(model, [PERIODIC]).chain, [PERIODIC])
    assert found.refused
    assert found.gaps <= 0.01


def test_what_a_model_cannot_make_is_refused_by_what_gives_it_away():
    (bursty,) = planted(GILBERT, 2000, 1)
    assert goodness.of(fitting.fitted("bernoulli", [bursty]).chain, [bursty]).bursts <= 0.01
    assert goodness.of(fitting.fitted("bernoulli", [DRIFTING]).chain, [DRIFTING]).spread <= 0.01
    assert goodness.of(fitting.fitted("gilbert", [DRIFTING]).chain, [DRIFTING]).refused


def test_what_a_model_made_is_hardly_ever_refused():
    refused = [goodness.of(fitting.fitted("gilbert", [one]).chain, [one]).refused for one in planted(GILBERT, 500, 60)]
    assert np.mean(refused) <= 2 / 60


@pytest.mark.parametrize(
    ("lost", "says"),
    [
        (np.zeros(100, dtype=bool), r"nothing was lost of 100 messages: the loss is at most 0.036 \(95 %\)"),
        (np.ones(100, dtype=bool), "everything was lost of 100 messages: the loss is at least 0.96"),
    ],
)
def test_what_tells_too_little_is_refused_with_what_is_known(lost, says):
    with pytest.raises(NotFitted, match=says):
        fitting.fitted("gilbert", [lost])


@pytest.mark.parametrize("model", fitting.MODELS)
@pytest.mark.parametrize(
    ("lost", "bursts"),
    [([False, True, False], 1), ([True, False, True, False], 2), ([False] * 9 + [True, False] * 9, 9)],
)
def test_of_a_few_messages_little_is_known_and_the_fit_says_so(model, lost, bursts):
    fit = fitting.fitted(model, [np.array(lost)])
    assert (fit.messages, fit.bursts, fit.few) == (len(lost), bursts, True)
    assert all(one.low <= one.value <= one.high for one in fit.parameters.values())
    if bursts == 1:
        assert all(one.high - one.low > 0.6 for one in fit.parameters.values())
    assert not fitting.fitted(model, [np.tile(np.array([False, False, True]), 10)]).few


def test_intervals_of_short_sequences_cover_the_truth_although_most_are_not_fitted():
    """Before: in 90 % of sequences of 10 messages, as those in which nothing was seen are refused."""
    each = []
    for one in planted(GILBERT, 10, 1500):
        with suppress(NotFitted):
            each.append(covered(fitting.fitted("gilbert", [one]), {"p": 0.03, "r": 0.3}))
    assert len(each) > 150
    assert (np.mean(each, axis=0) > 0.94).all()


def test_a_chain_in_finer_steps_has_the_same_loss_and_lasts_as_long():
    (lost,) = planted(GILBERT, 2000, 1)
    fit = fitting.fitted("gilbert", [lost])
    fine = fitting.in_steps_of(fit, 0.1)
    assert fine.chain.mean_loss == pytest.approx(fit.chain.mean_loss)
    p, r = (fine.parameters[name].value for name in "pr")
    coarse = np.linalg.matrix_power(fine.chain.transition, 10)
    np.testing.assert_allclose(coarse, fit.chain.transition, atol=1e-12)
    assert (p, r) < tuple(fit.parameters[name].value for name in "pr")
    with pytest.raises(NotFitted, match="a chain of four states is of the steps it was fitted in"):
        fitting.in_steps_of(fitting.Fit("markov", {}, 100, 9, 0.0, 0.0, MARKOV), 0.1)
    flipping = np.arange(100) % 2 == 0
    with pytest.raises(NotFitted, match="too closely for any other step"):
        fitting.in_steps_of(fitting.fitted("gilbert", [flipping]), 0.1)


def test_runs():
    held = np.array([[True, True, False, True], [False, False, False, True], [False] * 4])
    length, row = runs.lengths(held)
    assert length.tolist() == [2, 1, 1]
    assert row.tolist() == [0, 0, 1]
