"""Directed links: their order, the neighbour slots, and what a cut or a partition takes hold of."""

import numpy as np
import pytest

from netem.core.links import Links
from netem.faults import cut

# 1 - 2 - 3, and 1 - 4; agent 5 hears nobody.
LINKS = Links.both_ways(5, [(2, 3), (4, 1), (1, 2)])


def named(mask):
    return [f"{src}->{dst}" for src, dst in zip(LINKS.src[mask], LINKS.dst[mask], strict=True)]


def test_links_are_ordered_by_receiver_then_sender():
    pairs = list(zip(LINKS.dst.tolist(), LINKS.src.tolist(), strict=True))
    assert pairs == [(1, 2), (1, 4), (2, 1), (2, 3), (3, 2), (4, 1)]
    assert len(LINKS) == 6


def test_the_order_in_which_edges_are_named_does_not_matter():
    again = Links.both_ways(5, [(1, 2), (2, 1), (1, 4), (3, 2)])
    assert (again.src == LINKS.src).all()
    assert (again.dst == LINKS.dst).all()


def test_index_is_the_row_of_a_directed_link():
    assert LINKS.index == {(2, 1): 0, (4, 1): 1, (1, 2): 2, (3, 2): 3, (2, 3): 4, (1, 4): 5}


def test_degree_counts_the_links_toward_each_agent():
    assert LINKS.degree.tolist() == [2, 2, 1, 1, 0]


def test_slots_are_padded_to_the_largest_neighbourhood():
    assert LINKS.present.tolist() == [[True, True], [True, True], [True, False], [True, False], [False, False]]
    assert LINKS.slots[LINKS.present].tolist() == [0, 1, 2, 3, 4, 5]
    assert (LINKS.slots[~LINKS.present] == 0).all()


def test_neighbours_are_array_rows_in_the_order_of_the_slots():
    assert LINKS.neighbours[0].tolist() == [1, 3]  # agents 2 and 4
    assert LINKS.neighbours[1].tolist() == [0, 2]
    assert LINKS.neighbours[LINKS.present].tolist() == (LINKS.src - 1).tolist()


def test_every_real_slot_holds_a_link_toward_its_agent():
    agent, _ = np.nonzero(LINKS.present)
    assert (LINKS.dst[LINKS.slots[LINKS.present]] == agent + 1).all()


def test_links_touch_an_agent_at_either_end():
    agent_3 = np.array([False, False, True, False, False])
    assert named(LINKS.touching(agent_3)) == ["3->2", "2->3"]
    assert not LINKS.touching(np.zeros(5, dtype=bool)).any()


def test_a_swarm_without_edges_has_no_links():
    alone = Links.both_ways(2, [])
    assert len(alone) == 0
    assert alone.present.shape == alone.slots.shape == alone.neighbours.shape == (2, 0)


def test_a_cut_one_way_leaves_the_way_back():
    assert named(cut.severed(LINKS, [(1, 2)])) == ["1->2"]


def test_a_cut_both_ways_takes_both_links():
    assert named(cut.severed(LINKS, [(1, 2), (2, 1)])) == ["2->1", "1->2"]


def test_no_cut_severs_nothing():
    assert not cut.severed(LINKS, []).any()


@pytest.mark.parametrize("pair", [(1, 3), (3, 4), (1, 9)])
def test_a_cut_of_what_is_no_link_names_it(pair):
    with pytest.raises(ValueError, match=f"link {pair[0]}->{pair[1]} is not in the nominal graph"):
        cut.severed(LINKS, [(1, 2), pair])


def test_a_partition_separates_its_groups_both_ways():
    assert named(cut.separated(LINKS, [[1, 4], [2, 3]])) == ["2->1", "1->2"]


def test_agents_in_no_group_of_a_partition_stay_with_everybody():
    assert named(cut.separated(LINKS, [[1], [3]])) == []
    assert named(cut.separated(LINKS, [[4], [1]])) == ["4->1", "1->4"]


def test_a_partition_may_have_three_groups():
    assert named(cut.separated(LINKS, [[1, 4], [2], [3]])) == ["2->1", "1->2", "3->2", "2->3"]


@pytest.mark.parametrize("agent", [0, 6, -1])
def test_a_partition_of_an_agent_that_does_not_exist_names_it(agent):
    with pytest.raises(ValueError, match=f"agent {agent} does not exist: agents are 1 to 5"):
        cut.separated(LINKS, [[1], [2, agent]])


def test_a_partition_with_an_agent_in_two_groups_names_it():
    with pytest.raises(ValueError, match="agent 2 stands in two groups"):
        cut.separated(LINKS, [[1, 2], [2, 3]])
