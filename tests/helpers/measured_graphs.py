"""Random graphs whose edges are measured, and what least squares and the iteration make of them."""

from typing import NamedTuple

import numpy as np
import pytest

from analysis.models import jacobi
from analysis.models.jacobi import EdgeInformation, system, weights
from analysis.models.sensor import Sensor

SPACES = pytest.mark.parametrize("dimension", [2, 3])
LINE_OF_SIGHT = {D: Sensor("line-of-sight", np.diag([0.15**2] + [0.1**2] * (D - 1))) for D in (2, 3)}


class Measurement(NamedTuple):
    """What agent i, a row, said of x_i - x_j, and how surely."""

    i: int
    j: int
    y: np.ndarray
    covariance: np.ndarray


def weighed(ends, sensor):
    """Measurements (i, j, y), each as sure as the sensor is where the mean of those from both ends puts the other."""
    said = {(i, j): y for i, j, y in ends}
    both = {(i, j): np.mean([y, -said[j, i]] if (j, i) in said else [y], axis=0) for (i, j), y in said.items()}
    return [Measurement(i, j, y, sensor.spread(both[i, j])) for (i, j), y in said.items()]


def iteration(edges, step):
    """M_JOR = I - h D^-1 Upsilon (12), shape (..., N D, N D), with the step h."""
    matrix, _ = system(edges)
    own = weights(edges)
    rows = matrix.reshape(*own.shape[:-2], own.shape[-1], matrix.shape[-1])
    scaled = np.linalg.solve(own, rows).reshape(matrix.shape)
    return np.eye(matrix.shape[-1]) - step * scaled


def positive(size, rng):
    root = rng.normal(size=(size, size))
    return root @ root.T / size + 0.2 * np.eye(size)


def pairs(seed, agents=None):
    """A random connected graph, and where its randomness goes on."""
    rng = np.random.default_rng(seed)
    agents = int(rng.integers(3, 9)) if agents is None else agents
    tree = {(int(rng.integers(i)), i) for i in range(1, agents)}
    more = {(i, j) for i in range(agents) for j in range(i + 1, agents) if rng.random() < 0.3}
    return rng, agents, sorted(tree | more)


def campaign(seed, dimension=2):
    """Measurements on a random connected graph with full covariances; some edges are measured from one end, some from both."""
    rng, agents, joined = pairs(seed)
    made = []
    for i, j in joined:
        ends = [[(i, j)], [(j, i)], [(i, j), (j, i)]][rng.integers(3)]
        made += [Measurement(*end, rng.normal(size=dimension) * 3, positive(dimension, rng)) for end in ends]
    return agents, made, rng


def edges_of(agents, made, dimension=2):
    relative = np.zeros((agents, agents, dimension))
    information = np.zeros((agents, agents, dimension, dimension))
    for one in made:
        relative[one.i, one.j], information[one.i, one.j] = one.y, np.linalg.inv(one.covariance)
    return jacobi.together(relative, information)


def own_weights(agents, made, dimension=2):
    """Upsilon_ii: the information of all that was measured at agent i, or of it."""
    total = np.zeros((agents, dimension, dimension))
    for one in made:
        total[one.i] += np.linalg.inv(one.covariance)
        total[one.j] += np.linalg.inv(one.covariance)
    return total


def middle(place, own):
    """The weighted centroid (7)."""
    return np.linalg.inv(sum(own)) @ sum(w @ x for w, x in zip(own, place, strict=True))


def least_squares(agents, made, anchor, dimension=2):
    """Positions relative to an anchor (3)-(5): whitened measurements, the columns of the anchor left out."""
    rows, right = [], []
    for one in made:
        white = np.linalg.inv(np.linalg.cholesky(one.covariance))
        row = np.zeros((dimension, agents, dimension))
        row[:, one.i], row[:, one.j] = white, -white
        rows.append(np.delete(row, anchor, axis=1).reshape(dimension, -1))
        right.append(white @ one.y)
    found, *_ = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)
    return np.insert(found.reshape(agents - 1, dimension), anchor, 0.0, axis=0)


def chain(agents=10, spread=None):
    """Agents in a row, each edge measured once, as surely as the others."""
    information, pull = np.zeros((agents, agents, 2, 2)), np.zeros((agents, agents, 2))
    precision = np.linalg.inv(np.eye(2) if spread is None else spread)
    for i in range(agents - 1):
        information[i, i + 1] = information[i + 1, i] = precision
        pull[i, i + 1], pull[i + 1, i] = precision @ [1.0, 0.3], -precision @ [1.0, 0.3]
    return EdgeInformation(information, pull)


def iterates(edges, h, start, number):
    """(12), agent by agent; the start first."""
    own, place = weights(edges), [start]
    shift = h * np.linalg.solve(own, edges.pull.sum(axis=-2)[..., None])[..., 0]
    for _ in range(number):
        place.append((iteration(edges, h) @ place[-1].ravel()).reshape(start.shape) + shift)
    return np.stack(place)
