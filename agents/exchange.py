"""What agents say to each other: fields on channels, and what of them arrived."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from analysis.models.arrays import Mask

Fields = Mapping[str, Any]


class Field(NamedTuple):
    """A broadcast field: its shape, () for one value, and whether it holds numbers or truths."""

    shape: tuple[int, ...]
    dtype: type = float


Channels = Mapping[str, Mapping[str, Field]]


class Heard(NamedTuple):
    """What arrived on one channel.

    Parameters
    ----------
    fields
        Each broadcast field, gathered over the neighbours: shape (..., n, *field); anything where nothing arrived.
    fresh
        From which neighbours a message arrived in this tick, shape (..., n).
    """

    fields: Fields
    fresh: Mask
