"""What filters of edges do not know, against the textbook's filter of all of it; and inputs that are heard late."""

from dataclasses import replace

import numpy as np
import pytest
from briefs import brief

from agents.brief import Own
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.joint_kf import JointEdgeFilter
from agents.exchange import Heard

DT, EDGES, TICKS = 0.1, 3, 40
BOTH = pytest.mark.parametrize("kind", [EdgeKalmanFilter, JointEdgeFilter])
SPACES = pytest.mark.parametrize("dimension", [2, 3])


def positive(size, seed):
    """A covariance without zeros."""
    root = np.random.default_rng(seed).normal(size=(size, size))
    return 0.01 * (root @ root.T / size + 0.1 * np.eye(size))


def agent_of(dimension, kind, persistence=0.0, lateness=0):
    process = positive(EDGES * dimension, 3)
    if kind is EdgeKalmanFilter:  # which looks at each by itself
        process = process * np.kron(np.eye(EDGES), np.ones((dimension, dimension)))
    agent = brief(np.ones((EDGES, dimension)), positive(dimension, 7), process)
    return replace(agent, persistence=persistence, lateness=lateness)


def flight(dimension, heard=0.4):
    """What is measured, of which edges, what the agent and its neighbours fly, and whom it hears."""
    rng = np.random.default_rng(dimension)
    measured = rng.normal(size=(TICKS, EDGES, dimension)).cumsum(axis=0) / 10
    seen, fresh = rng.random((2, TICKS, EDGES)) < np.array([0.6, heard])[:, None, None]
    own, theirs = rng.normal(size=(TICKS, dimension)), rng.normal(size=(TICKS, EDGES, dimension))
    return measured, seen, own, theirs, fresh


def flown(filters, agent, measured, seen, own, theirs, fresh, age=None):
    """What a filter tells in every tick; `age` says how many ticks late each input is heard, below 0 never."""
    state, told = filters.init(agent, ()), []
    for k in range(len(own)):
        state, _ = filters.sense(agent, state, np.where(seen[k, :, None], measured[k], 0.0), seen[k])
        if age is None:
            said = Heard({"velocity": np.where(fresh[k, :, None], theirs[k], 99.0)}, fresh[k])
        else:
            said = late(theirs, age, k)
        state, estimate = filters.fuse(agent, state, {"input": said}, Own(own[k], own[k]))
        told.append(estimate)
    return told


def late(theirs, age, k):
    """The newest of what arrives in tick k."""
    arriving = [[s for s in range(k + 1) if age[s, j] >= 0 and s + age[s, j] == k] for j in range(EDGES)]
    newest = [max(ticks, default=-1) for ticks in arriving]
    fresh = np.array([tick >= 0 for tick in newest])
    values = np.where(fresh[:, None], theirs[newest, range(EDGES)], 99.0)
    return Heard({"velocity": values}, fresh, np.where(fresh, k - np.array(newest), 0))


class Textbook:
    """A filter of edges, the neighbours' last inputs and what displaced the edges, each with all coordinates in one matrix."""

    def __init__(self, agent, coefficients, sigma, prior):
        self.m, self.a, self.sigma, self.rho = len(agent.process), coefficients, sigma, agent.persistence
        self.Q, self.R = agent.process, np.kron(np.eye(EDGES), agent.sensor.covariance)
        size, m, p = self.m * (2 + len(coefficients)), self.m, len(coefficients)
        self.x, self.P = np.zeros(size), np.zeros((size, size))
        self.P[:m, :m], self.P[m : 2 * m, m : 2 * m] = prior, self.Q
        # In one step: displacements and inputs go on, and then the edges move by them.
        unit, self.F, self.G = np.eye(m), np.zeros((size, size)), np.zeros((size, 2 * m))
        go_on = np.zeros((1 + p, 1 + p))
        go_on[0, 0], go_on[1, 1:] = self.rho, coefficients
        go_on[range(2, 1 + p), range(1, p)] = 1.0
        self.F[m:, m:] = np.kron(go_on, unit)
        self.G[m : 2 * m, :m], self.G[2 * m : 3 * m, m:] = unit, unit
        self.move = np.eye(size)
        self.move[:m, m : 2 * m], self.move[:m, 2 * m : 3 * m] = unit, -DT * unit
        self.F[:m, :m] = unit

    def tick(self, y, seen, own, theirs, fresh):
        driven = np.zeros((2 * self.m, 2 * self.m))
        driven[: self.m, : self.m] = (1 - self.rho**2) * self.Q
        driven[self.m :, self.m :] = self.sigma**2 * np.eye(self.m)
        self.x, self.P = self.F @ self.x, self.F @ self.P @ self.F.T + self.G @ driven @ self.G.T
        rows = 2 * self.m + np.flatnonzero(np.repeat(fresh, len(own)))
        self.observe(rows, theirs[fresh].ravel(), np.zeros((len(rows), len(rows))))
        self.x, self.P = self.move @ self.x, self.move @ self.P @ self.move.T
        self.x[: self.m] += DT * np.tile(own, EDGES)
        rows = np.flatnonzero(np.repeat(seen, len(own)))
        self.observe(rows, y[seen].ravel(), self.R[np.ix_(rows, rows)])

    def observe(self, rows, values, R):
        K = self.P[:, rows] @ np.linalg.inv(self.P[np.ix_(rows, rows)] + R)
        self.x, self.P = self.x + K @ (values - self.x[rows]), self.P - K @ self.P[rows]


@pytest.mark.parametrize("persistence", [0.0, 0.8])
@pytest.mark.parametrize("a", [(0.9,), (1.9, -0.9), (0.5, 0.25, 0.1)])
@SPACES
@BOTH
def test_guesses_and_lasting_disturbances_are_those_of_the_textbooks_filter_of_all_unknowns(
    kind, dimension, a, persistence
):
    agent, filters = agent_of(dimension, kind, persistence), kind(coefficients=a, sigma_n=0.7)
    sharing = np.eye(EDGES) if kind is EdgeKalmanFilter else (np.ones((EDGES, EDGES)) + np.eye(EDGES)) / 2
    textbook = Textbook(agent, a, 0.7, 2.0 * np.kron(sharing, np.eye(dimension)))
    measured, seen, own, theirs, fresh = flight(dimension)
    for k, estimate in enumerate(flown(filters, agent, measured, seen, own, theirs, fresh)):
        textbook.tick(measured[k], seen[k], own[k], theirs[k], fresh[k])
        np.testing.assert_allclose(estimate.relative.ravel(), textbook.x[: textbook.m], atol=1e-8)
        for edge in range(EDGES):
            here = slice(edge * dimension, (edge + 1) * dimension)
            np.testing.assert_allclose(estimate.covariance[edge], textbook.P[here, here], atol=1e-8)


@pytest.mark.parametrize("a", [(1.0,), (1.2, -0.5, 0.25)])
@SPACES
@BOTH
def test_where_all_is_heard_and_nothing_lasts_it_is_the_papers_filter(kind, dimension, a):
    """That of sigma_n 0, which other tests hold against the papers' and filterpy's: nothing but edges is in doubt."""
    agent, given = agent_of(dimension, kind), flight(dimension, heard=1.0)
    plain, doubting = (flown(kind(coefficients=a, sigma_n=sigma), agent, *given) for sigma in (0.0, 0.7))
    for one, other in zip(plain, doubting, strict=True):
        np.testing.assert_allclose(other.relative, one.relative, rtol=0, atol=1e-12)
        np.testing.assert_allclose(other.covariance, one.covariance, rtol=0, atol=1e-12)
        np.testing.assert_allclose(other.reports["nis"], one.reports["nis"], rtol=1e-9)


@pytest.mark.parametrize(("a", "sigma"), [((0.9,), 0.7), ((0.5, 0.25), 0.7), ((1.0,), 0.0)])
@BOTH
def test_late_inputs_are_taken_as_if_they_had_been_heard_in_time(kind, a, sigma):
    """Bit for bit: what is believed is what a filter believes that knew, in every tick, the inputs heard by now."""
    memory = 6
    agent = agent_of(2, kind, persistence=0.5, lateness=20)
    filters = kind(coefficients=a, sigma_n=sigma, memory=memory)
    measured, seen, own, theirs, _ = flight(2)
    age = np.random.default_rng(1).integers(-1, memory + 3, size=(TICKS, EDGES))
    told = flown(filters, agent, measured, seen, own, theirs, None, age)
    arrived = np.zeros((TICKS, EDGES), dtype=bool)
    for k in range(TICKS):
        said = late(theirs, age, k)
        for j in np.flatnonzero(said.fresh & (said.age <= memory)):
            arrived[k - said.age[j], j] = True
        now = slice(0, k + 1)
        known = flown(filters, agent, measured[now], seen[now], own[now], theirs[now], arrived[now])[-1]
        np.testing.assert_array_equal(told[k].relative, known.relative)
        np.testing.assert_array_equal(told[k].covariance, known.covariance)
    assert (age > memory).any()
    assert arrived.sum() > 0.4 * arrived.size


@BOTH
def test_nothing_is_remembered_where_nothing_is_late(kind):
    agent = agent_of(2, kind)
    assert kind(memory=50).init(agent, ()).past.ticks.seen.shape == (1, EDGES)
    assert kind(memory=50).init(replace(agent, lateness=7), ()).past.ticks.seen.shape == (8, EDGES)
    assert kind(memory=3).init(replace(agent, lateness=7), ()).past.ticks.seen.shape == (4, EDGES)


@BOTH
def test_a_memory_of_less_than_nothing_is_refused(kind):
    with pytest.raises(ValueError, match="memory counts ticks"):
        kind(memory=-1)
