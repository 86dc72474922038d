"""What agents say to each other: fields on channels, and what of them arrived."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Integers, Mask

Fields = Mapping[str, Any]


class Field(NamedTuple):
    """A broadcast field: its shape, () for one value, and whether it holds numbers or truths."""

    shape: tuple[int, ...]
    dtype: type = float


Channels = Mapping[str, Mapping[str, Field]]

_IN_TIME = np.zeros((), dtype=np.int64)


class Heard(NamedTuple):
    """What arrived on one channel.

    Parameters
    ----------
    fields
        Each broadcast field, gathered over the neighbours: shape (..., n, *field); anything where nothing arrived.
    fresh
        From which neighbours a message arrived in this tick, shape (..., n).
    age
        How many ticks ago it was said, shape (..., n), 0 where nothing arrived; () where all is said in the tick.
    """

    fields: Fields
    fresh: Mask
    age: Integers = _IN_TIME
