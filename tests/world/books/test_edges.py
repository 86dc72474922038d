"""The edges of swarms, as metrics and recordings see them."""

import numpy as np
from flying import plan_of

from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.metrics import METRICS, of_run


def flown(*timeline):
    over = ("time.dt=0.05", "time.duration=4", 'agents.estimator="edge-kf"', f"timeline=[{', '.join(timeline)}]")
    return rehearse(plan_of("hexa", *over))


def test_who_has_departed_counts_in_no_metric_of_edges():
    """Before: an agent that drifts off without an estimator behind it made the error of the swarm."""
    run = flown(
        '{verb="depart",at=1.0,agents=[10],body="drift"}', '{verb="gust",at=1.0,agents=[10],velocity=[5.0,0.0]}'
    )
    assert isinstance(run, Evidence)
    neighbours, present = run.plan.world.links.neighbours, run.plan.world.links.present
    stays = np.arange(10) != 9
    counted = present & stays[:, None] & stays[neighbours]
    tick = run.ticks - 1
    position = run.arrays["position"][tick]
    off = run.arrays["estimate"][tick] - (position[:, None] - position[neighbours])
    known = run.arrays["known"][tick] & counted
    last = range(tick, tick + 1)
    np.testing.assert_allclose(of_run(run, "estimation_error", last), np.sqrt((off[known] ** 2).sum()), rtol=1e-9)
    together = np.sqrt((off[run.arrays["known"][tick] & present] ** 2).sum())
    assert together > 2 * of_run(run, "estimation_error", last)[0]
    assert all(np.isfinite(of_run(run, name, last)).all() for name in METRICS)
