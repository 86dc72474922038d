"""A formation designed: of nodes and a range, who sees whom, with which stress, behind which leaders."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from analysis.models.arrays import Array
from world.formation import stress
from world.formation.cliques import within
from world.formation.composed import compose
from world.formation.leading import led
from world.formation.nominal import Formation


class Design(NamedTuple):
    """A formation, and the smallest eigenvalue of its followers' block."""

    formation: Formation
    smallest: float


def design(nominal: Array, reach: float, least: float) -> Design:
    """A formation with weights of its own, symmetric and of largest eigenvalue 1, that settles as fast as is asked.

    Parameters
    ----------
    nominal
        Nominal positions, shape (N, D), in metres.
    reach
        Range of sensing and communication, in metres: all who are no farther apart have an edge.
    least
        The smallest eigenvalue of the followers' block: settling to 1/e takes 1 / (gain * least) seconds.

    Raises
    ------
    NotRigid
        When the range is too short for a stress.
    ValueError
        When no leaders make it settle so fast.
    """
    bare = Formation(nominal, within(nominal, reach), ())
    weights = compose(bare)
    chosen, smallest = led(nominal, sparse.csr_array(stress.laplacian(bare, weights)), least)
    return Design(Formation(nominal, bare.edges, chosen, np.column_stack([weights, weights])), smallest)
