"""What GA-RKF is worth: on a par with RKF where losses are independent, and it holds where they last."""

import numpy as np
import pytest
from flying import plan_of

from affinet.studies.batch import fly_all

SEEDS = range(1, 9)
BURSTS = (
    'network.profiles={ bursty = { loss = [{ model = "gilbert", loss = 0.3, burst = 10.0 }] } }',
    'network.profile="bursty"',
    "network.availability=1.0",
    "time.dt=0.05",
    "time.duration=20",
)


def flown(name, estimator, *overrides):
    return fly_all(plan_of(name, f'agents.estimator="{estimator}"', *overrides), SEEDS, 5)


@pytest.mark.parametrize("name", ["corridor", "hexa"])
def test_under_independent_losses_it_is_on_a_par_with_the_filter_alone(name):
    """Before: twice its error and more, for psi collapsed and the geometry was believed."""
    air = ("network.availability=0.7", "time.dt=0.02", "time.duration=20")
    alone, aware = (flown(name, estimator, *air) for estimator in ("rkf", "ga-rkf"))
    assert aware.mean_error.mean() < 1.1 * alone.mean_error.mean()
    settled = aware.quantities["nees"][:, 60:]
    assert 1.2 < np.nanmean(settled) < 2.1


def test_where_losses_last_it_holds_the_formation_that_the_filter_alone_loses():
    alone, aware = (flown("corridor", estimator, *BURSTS) for estimator in ("rkf", "ga-rkf"))
    assert aware.mean_error.mean() < 1.0
    assert alone.mean_error.mean() > 10.0


def test_the_demo_shows_it():
    """In the very scenario of `make demo`, with a tick five times as long: bursts of half a second."""
    bursts = 'network.profiles.bursts.loss=[{ model = "gilbert", loss = 0.3, burst = 10.0 }]'
    air = (bursts, "time.dt=0.05", "time.duration=40")
    none, alone, aware = (flown("bursts", estimator, *air) for estimator in ("none", "rkf", "ga-rkf"))
    since = aware.quantities["error"][:, aware.seconds >= 20]
    assert (since < 1.0).all()
    for lost in (none, alone):
        assert lost.mean_error.mean() > 10 * aware.mean_error.max()
