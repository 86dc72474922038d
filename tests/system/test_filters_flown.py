"""Filters of edges as they are flown: as wrong as they say, and the better the more they are told."""

import numpy as np
import pytest
from flying import plan_of

from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.side_by_side import side_by_side
from affinet.studies.batch import fly_all
from analysis.metrics.consistency import nees
from world.books.history import History

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
