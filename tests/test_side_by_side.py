"""Many runs of a plan flown as one: each of them bit for bit the run alone."""

import numpy as np
import pytest
from flying import plan_of

from affinet.batch import fly_all
from affinet.inprocess import Swarm
from affinet.run import rehearse
from affinet.side_by_side import NotABatch, side_by_side
from analysis import consistency, metrics
from world.history import History

SEEDS = (1, 7, 2**63 + 5)
SHORT = ("time.dt=0.05", "time.duration=3")
AIRS = {
    "lossy": (),
    "late": ("network.delay_ticks=2", "network.coupled=false"),
    "next-tick": ('time.exchange="next-tick"', "agents.parameters.varying-velocity.relaxation=0.3"),
    "wild": (
        'network.profile="wild"',
        'network.profiles.wild={like="wifi_busy",duplicate=0.1,corrupt=[{kind="bias",p=0.1,by=0.2}]}',
    ),
    "scripted": (
        'timeline=[{verb="kill",at=0.5,agents=[5]},{verb="restart",at=1.0,agents=[5],state="warm"},'
        '{verb="partition",at=1.0,lasts=0.5,groups="leaders",in_flight="hold"},{verb="lose",at=1.2,links=["all"],loss=0.4},'
        '{verb="gust",at=2,lasts=0.3,agents=["followers"],velocity=[0.5,0]},{verb="outlier",at=0,links=["all"],p=0.1,sigma=1},'
        '{verb="degrade",at=2.0,links=["2->4"],profile="wifi_clear"},{verb="dropout",at=2.2,links=["4"],p=0.5}]',
    ),
    "rkf": ('agents.estimator="rkf"', "dynamics.disturbance=0.01"),
}


# Gains that hold at this tick; the numbers of a swarm that diverges would be no numbers in the end, and agree.
GENTLE = ("agents.parameters.static.alpha=1", "agents.leader_gain=0.02")
PUSHED = 'dynamics={covariance=[[4e-4, 1e-4], [1e-4, 2e-4]], kernel={length=2.0, positions="%s"}, persistence=%s}'
RIGID = {
    "kernel": (PUSHED % ("nominal", 0.6), *GENTLE),
    "kernel-of-true-places": (
        PUSHED % ("true", 0.6),
        'agents.estimator="edge-kf"',
        "network.availability=0.7",
        *GENTLE,
    ),
}
FLIGHTS = [
    *(("corridor", air) for air in AIRS.values()),
    ("ravine", ("dynamics.disturbance=0.01",)),
    *(("rigid", air) for air in RIGID.values()),
]


@pytest.mark.parametrize(("name", "air"), FLIGHTS, ids=[*AIRS, "double-integrators", *RIGID])
def test_every_run_of_a_batch_is_the_run_alone(name, air):
    plan = plan_of(name, *SHORT, *air)
    batch, size, width = side_by_side(plan, SEEDS), plan.world.formation.agents, len(plan.world.links)
    together = History(batch.world, len(batch.channels), batch.reports)
    Swarm(batch).fly(together.extend, 20)
    flown = together.arrays()
    for place, seed in enumerate(SEEDS):
        alone = rehearse(plan_of(name, *SHORT, *air, f"seed={seed}")).arrays
        agents, links = slice(size * place, size * (place + 1)), slice(width * place, width * (place + 1))
        for array in ("position", "input", "estimate", "covariance", "psi", "known"):
            np.testing.assert_array_equal(flown[array][:, agents], alone[array], array)
        for array in ("fates", "newest"):
            np.testing.assert_array_equal(flown[array][..., links], alone[array], array)
        assert np.isfinite(alone["position"]).all()


def test_the_runs_of_a_study_are_those_runs():
    plan = plan_of("corridor", *SHORT)
    formation, links = plan.world.formation, plan.world.links
    runs = fly_all(plan, range(3, 60), every=4)
    alone = rehearse(plan_of("corridor", *SHORT, "seed=57"))
    np.testing.assert_array_equal(runs.error[54], alone.error[::4])
    np.testing.assert_array_equal(runs.psi[54], alone.arrays["psi"][::4])
    arrays = {name: array[:60:4] for name, array in alone.arrays.items()}
    position, known = arrays["position"], arrays["known"]
    true = position[..., :, None, :] - position[..., links.neighbours, :]
    expected = {
        "procrustes": metrics.procrustes_error(position, formation.nominal, np.ones((15, 7), dtype=bool)),
        "estimation_error": metrics.estimation_error(arrays["estimate"], true, known),
        "covariance_trace": metrics.covariance_trace(arrays["covariance"], 2),
        "nees": consistency.of_errors(arrays["estimate"], true, arrays["covariance"], known).mean,
    }
    for name, values in expected.items():
        assert len(np.unique(values)) == 15
        np.testing.assert_allclose(getattr(runs, name)[54], values, rtol=1e-12, err_msg=name)
        assert getattr(runs, name).shape == (57, 15)
    assert runs.mean_error[54] == pytest.approx(alone.error.mean(), rel=1e-12)
    np.testing.assert_allclose(runs.seconds, np.arange(0.0, 3.0, 0.2))


@pytest.mark.parametrize(
    ("over", "says"),
    [
        ("network.zones=[{centre=[0,0],radius=1}]", "jammed zone"),
        ("network.profiles.thin={rate={rate=1e5,queue=4000}}", "rate limit"),
        ('timeline=[{verb="cut",links=["all"],when={tracking_error_below=0.1}}]', "condition"),
    ],
)
def test_what_differs_between_runs_is_refused(over, says):
    with pytest.raises(NotABatch, match=says):
        side_by_side(plan_of("corridor", *SHORT, over, 'network.profile="thin"' if "thin" in over else over), SEEDS)
