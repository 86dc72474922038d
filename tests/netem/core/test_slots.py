"""Slots: where each neighbour has an agent, in a swarm and in swarms side by side."""

import numpy as np
from flying import plan_of
from localized_runs import NAME
from measured_graphs import pairs

from affinet.runtimes.side_by_side import side_by_side
from netem.core.links import Links


def test_each_neighbour_has_the_agent_in_the_slot_that_is_told():
    for seed in range(20):
        _, agents, joined = pairs(seed)
        links = Links.both_ways(agents, [(i + 1, j + 1) for i, j in joined])
        for each in (links, links.side_by_side(3)):
            for i, slot in np.argwhere(each.present).tolist():
                neighbour = each.neighbours[i, slot]
                assert each.neighbours[neighbour, each.back[i, slot]] == i
                assert each.present[neighbour, each.back[i, slot]]
            assert (each.back[~each.present] == 0).all()


def test_briefs_of_swarms_side_by_side_tell_the_slots_of_each():
    plan = plan_of(NAME)
    together = side_by_side(plan, [1, 2, 3])
    np.testing.assert_array_equal(together.brief.back, together.world.links.back)
    np.testing.assert_array_equal(together.brief.back, np.tile(plan.brief.back, (3, 1)))
    assert (plan.brief.of(6).back == plan.brief.back[6]).all()
