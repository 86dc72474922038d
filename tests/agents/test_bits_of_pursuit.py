"""What pursues a target, and who hears it from a centre: a batch of agents gives bit for bit what each gives alone."""

from dataclasses import replace

import numpy as np
import pytest
from flying import plan_of
from rows.surface import by_entry_point

from agents.agent import Agent
from agents.estimators.centralized import CentralizedFilter
from agents.estimators.target import TargetEstimator
from agents.laws.pursuit import Pursuit as PursuitLaw
from analysis.models.pursuit import Sighting
from tests.agents import test_bits

TICKS = 40
ESTIMATORS = {
    "smooth, agreed": TargetEstimator(theta=2.0, derivatives="agreed"),
    "smooth, own": TargetEstimator(theta=2.0, derivatives="own", alpha=0.3),
    "mean": TargetEstimator(fusion="mean"),
    "alone": TargetEstimator(fusion="none"),
    "spline": TargetEstimator(fusion="mean", output="spline"),
    "low-pass": TargetEstimator(theta=2.0, output="low-pass"),
    "jumping": TargetEstimator(fusion="none", output="optimal"),
}


def sightings(rng, agents, methods):
    """Detections that end in some ticks."""
    for _ in range(TICKS):
        by, method = rng.integers(0, methods, (2, agents))
        yield Sighting(rng.normal(size=(agents, 2)), rng.random(agents) < 0.2, by, method)


@pytest.mark.parametrize("estimator", ESTIMATORS.values(), ids=ESTIMATORS)
def test_a_batch_of_agents_gives_the_bits_of_each_agent_alone(estimator):
    plan = plan_of("target", "time.duration=0.2")
    brief, links, rng = plan.agents.brief, plan.world.links, np.random.default_rng(3)
    everybody = Agent(brief, estimator, PursuitLaw(), leaders="pilot", leader_gain=1.0, limit=None)
    rows = [replace(everybody, brief=brief.of(row)) for row in range(links.agents)]
    together, apart = everybody.init((links.agents,)), [one.init(()) for one in rows]
    measured = np.zeros((*links.present.shape, 2))
    for step, sighting in enumerate(sightings(rng, links.agents, len(brief.target.latencies))):
        tick = 37 * step  # so that detections are done by all shares of their latency
        position, motion = rng.normal(size=(links.agents, 2)), rng.normal(size=(links.agents, 1, 2))
        fresh = links.present & (rng.random(links.present.shape) < 0.7)
        together, said = everybody.sense(together, step, measured, fresh, motion)
        heard = test_bits.gather(said, links.neighbours, fresh)
        together, action = everybody.act(together, tick, heard, position, motion, sighting)
        for row, one in enumerate(rows):
            state, told = one.sense(apart[row], step, measured[row], fresh[row], motion[row])
            mine = Sighting(*(field[row] for field in sighting))
            arrived = test_bits.row_of(heard, row)
            apart[row], alone = one.act(state, tick, arrived, position[row], motion[row], mine)
            pairs = zip(
                test_bits.leaves((told, alone, apart[row])), test_bits.leaves((said, action, together)), strict=True
            )
            assert all(single.tobytes() == many[row].tobytes() for single, many in pairs)
    assert np.isfinite(action.input).all()
    assert together.estimator.settled.all()


def test_every_estimator_and_law_is_called_alone_and_in_a_batch():
    flown = [*test_bits.ESTIMATORS.values(), *test_bits.LAWS.values(), *ESTIMATORS.values(), PursuitLaw()]
    told = {CentralizedFilter}  # what its centre decides is a row of tests/helpers/rows; itself passes it on
    classes = {f"{kind.__module__}.{kind.__name__}" for kind in {*map(type, flown), *told}}
    assert by_entry_point() == classes
