"""Random graphs: they join all agents, and on none of them an anchor makes localization faster."""

import numpy as np

from analysis.claims import random_graphs
from analysis.metrics.localization import optimal


def test_an_anchor_never_makes_it_faster():
    centre, anchor = random_graphs.rates(1000, 10, 0.49).T
    assert (centre <= anchor + 1e-12).all()
    assert (centre < anchor - 1e-3).mean() > 0.9
    assert ((centre > 0.0) & (anchor < 1.0)).all()


def test_random_graphs_join_all_agents_and_are_the_same_for_the_same_seed():
    for seed in range(20):
        edges, again = (random_graphs.edges(seed, 10) for _ in range(2))
        assert np.isfinite(optimal(edges)).all()
        np.testing.assert_array_equal(edges.pull, again.pull)
    assert np.abs(random_graphs.edges(1, 10).pull - random_graphs.edges(2, 10).pull).max() > 0.1
