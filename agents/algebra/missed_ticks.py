"""What becomes of a state in ticks that its agent missed: each is lived, with nothing measured and nothing heard."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from analysis.models.arrays import Integers, chosen

T = TypeVar("T", bound=tuple[Any, ...])

# By then a filter of edges knows hardly more than at the beginning, and an agent that goes on has a tick's time for all of it.
LONGEST = 1000


def lived(state: T, ticks: Integers, live: Callable[[T, int], T], fresh: Callable[[], T]) -> T:
    """The state after the ticks that were missed; a fresh one where they are more than `LONGEST`.

    Parameters
    ----------
    state
        Before them.
    ticks
        How many there are, shape (...).
    live
        What a tick makes of a state, by how many of them went before.
    fresh
        Makes the state of who remembers nothing.
    """
    forgotten = np.asarray(ticks > LONGEST)
    left = np.where(forgotten, 0, ticks)
    for gone in range(int(left.max(initial=0))):
        state = chosen(left > gone, live(state, gone), state)
    return chosen(forgotten, fresh(), state) if forgotten.any() else state
