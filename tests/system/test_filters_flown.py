"""Filters of edges as they are flown: as wrong as they say, and the better the more they are told."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
import pytest
from flying import plan_of
from scripted import timeline

from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.side_by_side import side_by_side
from affinet.studies.batch import fly_all
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.ga_rkf import GeometryAwareFilter
from agents.estimators.imm import InteractingMultipleModel
from agents.estimators.joint_kf import JointEdgeFilter
from agents.estimators.rkf import RelativeKalmanFilter
from analysis.metrics.consistency import nees
from world.books.history import History

A, SIGMA = 0.98, 0.1  # m/s, in a tick


class Nothing(NamedTuple):
    """It remembers nothing."""


@dataclass(frozen=True)
class Wandering:
    """Flies inputs that follow the model of filters: what drives them are the last digits of an estimate, as good as noise."""

    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = False

    def init(self, _brief, _batch):
        return Nothing()

    def command(self, _brief, state, _tick, own, estimate, _inputs):
        digits = 1e7 * estimate.relative[..., 0, :]
        uniform = digits - np.floor(digits)
        return state, A * own.input + SIGMA * np.sqrt(12.0) * (uniform - 0.5)


MUTE = ("network.coupled=false", 'network.links=[{links="all",channels="comms",availability=0.000001}]')
HALF_BLIND = 'network.links=[{links="all",channels="sensing",availability=0.5}]'


@pytest.mark.parametrize("estimator", ["edge-kf", "joint-kf"])
def test_in_flight_the_filters_are_as_wrong_as_they_say(estimator):
    runs = 150
    coarse = ("time.dt=0.01", "time.duration=0.6", "dynamics.disturbance=0.02", "network.coupled=false")
    plan = plan_of("rigid", *coarse, HALF_BLIND, f"agents.estimator={estimator}")
    batch = side_by_side(plan, range(1, 1 + runs))
    links, flown = batch.world.links, History(batch.world, len(batch.channels), batch.reports)
    InProcessSwarm(batch).fly(flown.extend, 60)
    arrays = flown.arrays()
    position = arrays["position"][:-1]
    off = arrays["estimate"] - (position[:, :, None] - position[:, links.neighbours])
    for now in (0, 1, 5, 59):
        wrong = nees(off[now], arrays["covariance"][now])
        of_runs = np.array(
            [wrong[links.present & (np.arange(10 * runs) // 10 == run)[:, None]].mean() for run in range(runs)]
        )
        # Edges of a run have their disturbances in common, and runs have nothing.
        assert abs(of_runs.mean() - 2.0) < 4 * of_runs.std() / np.sqrt(runs) < 0.5


def test_without_communication_it_beats_taking_neighbours_for_at_rest_and_not_the_clairvoyant():
    rest = ('agents.estimator="edge-kf"', "agents.parameters.edge-kf.coefficients=[]", *MUTE)
    cases = (('agents.estimator="edge-kf"',), ('agents.estimator="silent-kf"', *MUTE), rest)
    errors = [
        fly_all(plan_of("rigid", "time.dt=0.01", "time.duration=2", *case), range(1, 11), 1)
        .quantities["estimation_error"][:, 10:]
        .mean()
        for case in cases
    ]
    assert errors[0] < 0.5 * errors[1] < 0.5 * errors[2]


COARSE = ("time.dt=0.05", "time.duration=2.5", "record.enabled=false", "network.coupled=false")
WANDERING = (
    *COARSE,
    "formation.leaders=[]",
    'agents.leaders="pilot"',
    f'agents.law="{__name__}:Wandering"',
    "sensing={sigma=0.3}",
)
FILTERS = pytest.mark.parametrize("estimator", ["edge-kf", "joint-kf"])


def consistent(estimator, *over, runs=50):
    """Whether NEES is that of a filter that tells the truth, after a second and over all ticks, in the mean over the runs."""
    found = fly_all(plan_of("rigid", *over, f'agents.estimator="{estimator}"'), range(1, 1 + runs), 1).quantities
    of_runs = found["nees"][:, 20:].mean(axis=1)
    error = of_runs.std() / np.sqrt(runs)
    assert error < 0.05
    assert abs(of_runs.mean() - 2.0) < 4 * error, of_runs.mean()
    assert abs(np.nanmean(found["nis"][:, 20:]) - 2.0) < 0.05


def guessing(estimator):
    return f"agents.parameters.{estimator}={{ coefficients = [{A}], sigma_n = {SIGMA} }}"


@FILTERS
def test_what_is_guessed_of_inputs_lasts(estimator):
    """Before, each guess counted as wrong by itself."""
    lost = 'network.links=[{links="all",channels="comms",availability=0.1}]'
    consistent(estimator, *WANDERING, lost, guessing(estimator))


@FILTERS
def test_inputs_that_are_heard_late_count_for_the_tick_they_were_flown_in(estimator):
    """Before, each was taken for that of now."""
    consistent(estimator, *WANDERING, "network.delay_ticks=10", guessing(estimator))


@pytest.mark.parametrize("estimator", ["edge-kf", "joint-kf", "crkf"])
def test_disturbances_that_persist_push_again(estimator):
    """Before, each counted as a new one."""
    consistent(estimator, *COARSE, "dynamics={disturbance=0.02, persistence=0.9}")


# ---- ticks that an agent missed

OUT = {
    "pause": timeline({"verb": "pause", "at": 0.5, "lasts": 1.5, "agents": [1]}),
    "warm restart": timeline(
        {"verb": "kill", "at": 0.5, "agents": [1]},
        {"verb": "restart", "at": 2.0, "agents": [1], "state": "warm"},
    ),
}
# Bodies that nobody steers, and that are pushed about: relative positions are random walks, which the filters know.
DT, PUSH = 0.05, 0.01  # s, m
PUSHED = (
    *COARSE,
    "agents.law=rest",
    "formation.leaders=[]",
    'agents.leaders="pilot"',
    "sensing={sigma=0.05}",
    f"dynamics={{disturbance={PUSH}}}",
)
WALK = PUSH * np.sqrt(2.0) / DT  # m/s
RANDOM_WALK = f'{{ model = "random-walk", sigma_w = {WALK} }}'
ANY_WALK = f"{{ sigma_random_walk = {WALK} }}"
MISSING = {
    "edge-kf": (EdgeKalmanFilter, (*WANDERING, guessing("edge-kf"))),
    "joint-kf": (JointEdgeFilter, (*WANDERING, guessing("joint-kf"))),
    "rkf": (RelativeKalmanFilter, (*PUSHED, f"agents.parameters.rkf={RANDOM_WALK}")),
    "ga-rkf": (GeometryAwareFilter, (*PUSHED, f"agents.parameters.ga-rkf={RANDOM_WALK}")),
    "imm": (InteractingMultipleModel, (*PUSHED, f"agents.parameters.imm={ANY_WALK}")),
}


def after_the_gap(estimator, over, out, runs=40):
    """NEES of the edges of the agent that was out, in the three ticks after it: its mean, and its standard error."""
    plan = plan_of("rigid", "time.duration=2.15", *over, f'agents.estimator="{estimator}"', OUT[out])
    batch = side_by_side(plan, range(1, 1 + runs))
    flown = History(batch.world, len(batch.channels), batch.reports)
    InProcessSwarm(batch).fly(flown.extend, 43)
    arrays, links = flown.arrays(), batch.world.links
    position = arrays["position"][:-1]
    off = arrays["estimate"] - (position[:, :, None] - position[:, links.neighbours])
    wrong = nees(off, arrays["covariance"])[40:, ::10][..., links.present[0]]
    of_runs = wrong.mean(axis=(0, 2))
    return of_runs.mean(), of_runs.std() / np.sqrt(runs)


def tells_the_truth(mean, error):
    return error < 0.15 and abs(mean - 2.0) < 4.0 * error


@pytest.mark.parametrize("out", OUT)
@pytest.mark.parametrize("estimator", MISSING)
def test_who_missed_ticks_is_as_wrong_as_it_says(estimator, out, monkeypatch):
    """Before, it took one step for all of them."""
    kind, over = MISSING[estimator]
    found = after_the_gap(estimator, over, out)
    assert tells_the_truth(*found), found
    monkeypatch.setattr(kind, "missed", lambda _self, _brief, state, _gap: state)
    as_before = after_the_gap(estimator, over, out)
    assert not tells_the_truth(*as_before), as_before
