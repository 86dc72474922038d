"""Who leads a large formation: those that span it, and who moves most in what is slowest without them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from analysis.models.arrays import Array
from world.formation import spectrum


def corners(nominal: Array) -> list[int]:
    """Rows of D + 1 of the nodes (N, D) that span far: each is the farthest from the point, line or plane of those before."""
    rest = nominal - nominal.sum(axis=0) / len(nominal)
    found: list[int] = []
    for _ in range(nominal.shape[-1] + 1):
        far = (rest * rest).sum(axis=-1)
        far[found] = -1.0
        found.append(int(np.argmax(far)))
        if len(found) == 1:
            rest = nominal - nominal[found[0]]
        else:
            along = rest[found[-1]] / np.sqrt(far[found[-1]])
            rest = rest - (rest * along).sum(axis=-1, keepdims=True) * along
    return found


class Led(NamedTuple):
    """Who leads, agents numbered from 1, and the smallest eigenvalue of the followers' block that they leave."""

    leaders: tuple[int, ...]
    smallest: float


def led(nominal: Array, stress: sparse.csr_array, least: float) -> Led:
    """Who holds a formation so that its followers settle.

    First the corners; then, one by one, who moves most in the slowest mode of the followers, which is what a leader there
    takes away (docs/decisions/0025 has what else was tried).

    Parameters
    ----------
    nominal, stress
        Nominal positions (N, D), in metres, and the stress matrix (N, N), symmetric, without negative eigenvalues.
    least
        The smallest eigenvalue that the followers' block must have; settling to 1/e takes 1 / (gain * least) seconds.

    Raises
    ------
    ValueError
        When all but one would have to lead, and that is not enough.
    """
    found, scale = corners(nominal), spectrum.largest(stress)
    while len(found) < len(nominal):
        followers = np.setdiff1d(np.arange(len(nominal)), found)
        smallest, mode = spectrum.slowest(stress[followers][:, followers], scale)
        if smallest >= least:
            return Led(tuple(row + 1 for row in sorted(found)), smallest)
        found.append(int(followers[np.argmax(np.abs(mode))]))
    raise ValueError(f"no leaders make the smallest eigenvalue {least:g}, where the largest is {scale:g}")
