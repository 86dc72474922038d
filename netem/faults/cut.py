"""Cut links and partitions: nothing passes, one way or between groups."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.models.arrays import Mask
from netem.core.links import Links


def severed(links: Links, pairs: Sequence[tuple[int, int]]) -> Mask:
    """True on the directed links (src, dst) that are cut, shape (L,); the way back is another pair.

    Raises
    ------
    ValueError
        When a pair is no link of the nominal graph: such a cut could never bite.
    """
    mask = np.zeros(len(links), dtype=bool)
    for src, dst in pairs:
        if (src, dst) not in links.index:
            raise ValueError(f"link {src}->{dst} is not in the nominal graph")
        mask[links.index[src, dst]] = True
    return mask


def separated(links: Links, groups: Sequence[Sequence[int]]) -> Mask:
    """True on the links that cross between groups, shape (L,); agents in no group stay with everybody.

    Raises
    ------
    ValueError
        When an agent does not exist or stands in two groups.
    """
    group_of = np.full(links.agents + 1, -1, dtype=np.int64)
    for number, group in enumerate(groups):
        for agent in group:
            if not 1 <= agent <= links.agents:
                raise ValueError(f"agent {agent} does not exist: agents are 1 to {links.agents}")
            if group_of[agent] >= 0:
                raise ValueError(f"agent {agent} stands in two groups")
            group_of[agent] = number
    src, dst = group_of[links.src], group_of[links.dst]
    crossing: Mask = (src != dst) & (src >= 0) & (dst >= 0)
    return crossing
