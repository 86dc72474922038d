"""Where agents begin, each from its own: what a scenario gives for every agent by its number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.models.arrays import Array, Integers
from analysis.models.finding import Finding


def own(given: Sequence[Any], number: Integers, shape: tuple[int, ...]) -> Array:
    """What is given for the agents of these numbers (...), from 1, shape (..., *shape); 0 where nothing is given."""
    if not given:
        return np.zeros((*np.shape(number), *shape))
    of_all = np.array(given, dtype=np.float64)
    return np.asarray(of_all[np.asarray(number) - 1], dtype=np.float64)


def suits(name: str, given: Sequence[Any], agents: int, shape: tuple[int, ...]) -> list[Finding]:
    """An error unless something of this shape is given for each of so many agents, or nothing."""
    if not given:
        return []
    try:
        found = np.array(given, dtype=np.float64).shape
    except ValueError:
        found = ()
    if found == (agents, *shape):
        return []
    wanted = " x ".join(map(str, shape))
    return [Finding(name, "error", f"{name} has {wanted} numbers for each of the {agents} agents, in their order")]
