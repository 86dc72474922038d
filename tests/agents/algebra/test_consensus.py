"""Steps of REDCHO by hand, and ten agents in a ring that agree on the mean of their signals."""

import numpy as np

from agents.algebra.redcho import Consensus


def test_what_internals_take_from_the_output_is_row_by_row_that_of_the_errata():
    # C_0 Gamma^mu with Gamma = A_0 - diag(2, 3, 5), by hand.
    G = np.array([[1.0, 0.0, 0.0], [-2.0, 1.0, 0.0], [4.0, -5.0, 1.0]])
    consensus = Consensus(2, 7.0, (6.0, 11.0, 6.0), (2.0, 3.0, 5.0))
    local, internal = np.arange(12.0).reshape(3, 1, 4), np.random.default_rng(0).normal(size=(1, 3, 4))
    np.testing.assert_allclose(consensus.outputs(local, internal)[:, 0], local[:, 0] - G @ internal[0], atol=1e-12)
    for order in (1, 2, 3, 4):
        gamma = np.arange(1.0, order + 2)
        Gamma = np.eye(order + 1, k=1) - np.diag(gamma)
        rows = np.stack([np.linalg.matrix_power(Gamma, mu)[0] for mu in range(order + 1)])
        mixing = -Consensus(order, 1.0, (1.0,) * (order + 1), tuple(gamma)).outputs(
            np.zeros((order + 1, order + 1)), np.eye(order + 1)
        )
        np.testing.assert_allclose(mixing, rows, atol=1e-12)


def test_a_step_of_the_consensus_by_hand():
    consensus = Consensus(2, 10.0, (6.0, 11.0, 7.0), (2.0, 3.0, 5.0))
    internal = np.array([[1.0], [10.0], [100.0]])
    # The neighbours are 8 above, and 1 below: roots -4 + 1, -2 + 1, -1 + 1.
    moved = consensus.step(internal, np.array([0.0]), np.array([[8.0], [-1.0], [0.0]]), 0.01)
    rates = [6 * 10 * -3 + 10 - 2 * 1, 11 * 100 * -1 + 100 - 3 * 10, 7 * 1000 * 0 - 5 * 100]
    np.testing.assert_allclose(moved[:, 0], [1 - 1.72, 10 - 10.30, 100 - 5.0], rtol=1e-12)
    np.testing.assert_allclose(moved[:, 0], internal[:, 0] + 0.01 * np.array(rates), rtol=1e-12)
    lonely = consensus.step(internal, np.array([3.0]), np.array([[3.0]]), 0.01)
    np.testing.assert_allclose(lonely[:, 0], [1 + 0.01 * 8, 10 + 0.01 * 70, 95.0], rtol=1e-12)


def ring(dt, seconds, theta=5.0):
    """How far ten agents are from the mean of their sinusoids and of its derivatives, and the sum of their internals."""
    agents, rng = np.arange(10), np.random.default_rng(0)
    size, rate, phase = rng.uniform(0.5, 1.5, 10), rng.uniform(0.3, 1.0, 10), rng.uniform(0, 6, 10)
    neighbours = np.stack([agents - 1, (agents + 1) % 10], axis=1)
    consensus, internal = Consensus(2, theta, (6.0, 11.0, 6.0), (1.0, 1.0, 1.0)), np.zeros((10, 3, 1))
    off, total = [], 0.0
    for tick in range(round(seconds / dt)):
        angle = rate * tick * dt + phase
        local = np.stack([size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle)])[
            ..., None
        ]
        said = consensus.outputs(local, internal)
        off.append(np.abs(said - local.mean(axis=1, keepdims=True)).max(axis=(1, 2)))
        internal = consensus.step(internal, said[0], said[0][neighbours], dt)
        total = max(total, float(np.abs(internal.sum(axis=0)).max()))
    return np.array(off), total, float(np.abs(internal).max())


def test_agents_in_a_ring_agree_on_the_mean_of_their_signals_and_its_derivative():
    off, total, largest = ring(1e-4, 0.8)
    assert (off[0] > [0.5, 0.5, 0.2]).all()
    assert (off[-500:].max(axis=0)[:2] < [1e-5, 1e-2]).all()
    assert total < 1e-10 < largest


def test_shorter_steps_make_the_agreement_closer():
    coarse, fine = (ring(dt, 0.6)[0][-int(0.1 / dt) :].max(axis=0) for dt in (1e-3, 1e-4))
    assert (coarse > np.array([100, 20, 3]) * fine).all()
