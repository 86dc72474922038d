"""Large formations fly as their spectrum says."""

import numpy as np
import pytest
from extremes import BASES
from flying import PROCESSES, digest_of, plan_of

from affinet.planning import making
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario.sections import Scenario


@pytest.mark.parametrize("preset", ["swarm50", "swarm50-3d"])
def test_the_error_of_a_swarm_falls_as_fast_as_the_slowest_mode_of_its_followers(preset):
    plan = making.make(
        Scenario.model_validate(
            {
                "formation": {"preset": preset},
                "manoeuvre": {"preset": "hover"},
                "time": {"dt": 0.05, "duration": 40.0},
                "sensing": {"sigma": 1e-6},
                "agents": {"estimator": "none", "law": "static"},
            }
        )
    )
    followers = ~plan.world.formation.is_leader
    slow = np.linalg.eigvalsh(plan.swarm.stress[np.ix_(followers, followers)])[0]
    error = rehearse(plan).arrays["error"]
    # Squared, and after 20 s little of the next modes is left, which makes it a few percent faster.
    fallen = np.log(error[400] / error[-1])
    predicted = 2.0 * 10.0 * slow * 0.05 * (len(error) - 401)
    assert predicted < fallen < 1.15 * predicted


@PROCESSES
def test_weights_that_are_not_alike_both_ways_fly_over_processes_with_the_same_bits(out):
    formation, factor = BASES["weights"]["formation"], {4: 1.0, 5: 2.0, 6: 0.5, 7: 3.0}  # leaders weigh nobody
    ends = [tuple(map(int, edge.split("-"))) for edge in formation["edges"]]
    given = [
        [weight * factor.get(i, 0.0), weight * factor.get(j, 0.0)]
        for weight, (i, j) in zip(formation["weights"], ends, strict=True)
    ]
    flown = ("corridor", "time.duration=0.5", "agents.law=static", "agents.parameters.static.alpha=1.0")
    asked = (*flown, f"formation.weights={given}")
    outcome = fly(plan_of(*asked), "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of(*asked)
    assert outcome.digest != digest_of(*flown)
