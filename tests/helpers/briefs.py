"""Agents without a swarm: their briefs, and what they hear."""

import numpy as np

from agents.brief import Brief, Own
from agents.estimate import Estimate
from agents.exchange import Heard
from agents.swarm import SwarmBrief
from analysis.models.sensor import Sensor
from netem.core.channels import INPUT, THETA
from netem.core.links import Links

HEXA4 = np.array([[-2, 0], [-1, -2], [-1, 2], [2, 0], [3, -2], [3, 2]], dtype=float)  # what agent 4 of hexa10 sees
REST = Own(np.zeros(1), np.zeros(1))  # an agent, in any dimension, that has flown nothing
OCTAHEDRON = 2 * np.concatenate([np.eye(3), -np.eye(3)])  # seen from (1, 1, 1)

# An agent at (1, 1) with neighbours at (0, 0) and (1, 0), and one slot of padding.
BRIEF = Brief(
    dt=0.1,
    number=np.array(1),
    nominal=np.array([1.0, 1.0]),
    relative=np.array([[1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]),
    present=np.array([True, True, False]),
    back=np.zeros(3, dtype=np.int64),
    stress=np.array([3.0, -1.0, 0.0]),
    leads=np.zeros(3, dtype=bool),
    sensor=Sensor("coordinates", 0.01 * np.eye(2)),
    process=np.zeros((6, 6)),
    persistence=0.0,
    lateness=0,
    leader=np.array(False),
    target=None,
    mission=None,
)
ESTIMATE = Estimate(
    relative=np.array([[1.0, 2.0], [4.0, -1.0], [9.0, 9.0]]),
    known=np.array([True, True, False]),
    covariance=np.broadcast_to(np.eye(2), (3, 2, 2)),
    psi=np.array(np.nan),
)
FORCE = np.array([3 * 1.0 - 4.0, 3 * 2.0 + 1.0])  # (-1, 7)


def brief(relative, covariance=None, process=None):
    """An agent with neighbours at these nominal relative positions; with leading axes, many."""
    relative = np.asarray(relative, dtype=float)
    size = relative.shape[-2] * relative.shape[-1]
    return Brief(
        dt=0.1,
        number=np.arange(1, 1 + int(np.prod(relative.shape[:-2]))).reshape(relative.shape[:-2]),
        nominal=np.zeros((*relative.shape[:-2], relative.shape[-1])),
        relative=relative,
        present=(relative != 0).any(axis=-1),
        back=np.zeros(relative.shape[:-1], dtype=np.int64),
        stress=np.ones(relative.shape[:-1]),
        leads=np.zeros(relative.shape[:-1], dtype=bool),
        sensor=Sensor("coordinates", 0.01 * np.eye(relative.shape[-1]) if covariance is None else covariance),
        process=np.zeros((*relative.shape[:-2], size, size)) if process is None else process,
        persistence=0.0,
        lateness=0,
        leader=np.zeros(relative.shape[:-2], dtype=bool),
        target=None,
        mission=None,
    )


def swarm(formation):
    """Every agent of a formation, and the rows of its neighbours."""
    links = Links.both_ways(formation.agents, formation.edges)
    relative = formation.nominal[:, None] - formation.nominal[links.neighbours]
    return brief(np.where(links.present[..., None], relative, 0.0)), links


def of_all(formation, **known):
    """What is known of a swarm of this formation, where nothing disturbs it and everything arrives in time."""
    links = Links.both_ways(formation.agents, formation.edges)
    agents, dimension = formation.nominal.shape
    plain = {
        "dt": 0.1,
        "ticks": 100,
        "order": 1,
        "late": (),
        "lateness": 0,
        "persistence": 0.0,
        "stress": np.zeros((agents, agents)),
        "sensor": Sensor("coordinates", 0.01 * np.eye(dimension)),
        "correlation": np.eye(agents),
        "displacement": np.zeros((dimension, dimension)),
    }
    return SwarmBrief(
        nominal=formation.nominal,
        neighbours=links.neighbours,
        present=links.present,
        leader=formation.is_leader,
        **{**plain, **known},
    )


def hears(who, velocity=(0.0,), **fields):
    """What arrived from `who`: its inputs, and these fields of its map."""
    who = np.asarray(who)
    flown = np.broadcast_to(velocity, (*who.shape, np.shape(velocity)[-1]))
    said = {name: np.asarray(value) for name, value in fields.items()}
    return {THETA: Heard(said, who), INPUT: Heard({"velocity": flown}, who)}


def silence(n, dimension=2):
    nothing, no = np.zeros((n, dimension, dimension)), np.zeros(n, dtype=bool)
    return hears(no, local=nothing, feasible=no, consensus=nothing, started=no)


def only(n, *rows):
    return np.isin(np.arange(n), rows)
