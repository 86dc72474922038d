"""Corrupted messages, by kind: what arrives is wrong, but arrives.

Bias, NaN and bit flips act on the floating-point numbers of a message in the order of its fields' names; a stale message says
what its sender said the tick before.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.models.arrays import Array

Marks = NDArray[np.uint8]


class Mark(IntEnum):
    """How a message is corrupted."""

    NONE = 0
    STALE = 1
    BIAS = 2
    NAN = 3
    BIT_FLIP = 4

    @property
    def label(self) -> str:
        """Its name in scenarios and journals."""
        return self.name.lower().replace("_", "-")


def marks(chances: Array, draw: Array) -> Marks:
    """Which kind strikes each message, shape (..., L): kinds exclude each other.

    Parameters
    ----------
    chances
        Probability of STALE, BIAS, NAN and BIT_FLIP, shape (L, 4); they add up to at most 1.
    draw
        Uniform, shape (..., L).
    """
    summed = np.cumsum(chances, axis=-1)
    below = draw[..., None] >= summed
    kind = below.sum(axis=-1) + 1
    return np.where(kind > chances.shape[-1], 0, kind).astype(np.uint8)


def corrupted(numbers: Array, kind: Marks, bias: Array, draw: Array) -> Array:
    """The numbers of messages (m, K) as they arrive.

    Parameters
    ----------
    numbers
        A row per message, as sent.
    kind
        Shape (m,).
    bias
        What BIAS adds to every number, shape (m,).
    draw
        Uniform, shape (m, 2): which number BIT_FLIP strikes, and which of its 64 bits.
    """
    if not numbers.shape[-1]:
        return numbers
    wrong = np.where((kind == Mark.BIAS)[:, None], numbers + bias[:, None], numbers)
    wrong = np.where((kind == Mark.NAN)[:, None], np.nan, wrong)
    struck = np.flatnonzero(kind == Mark.BIT_FLIP)
    place = (draw[struck, 0] * numbers.shape[-1]).astype(np.int64)
    bit = np.uint64(1) << (draw[struck, 1] * 64).astype(np.uint64)
    flipped = wrong[struck, place].copy().view(np.uint64) ^ bit
    wrong[struck, place] = flipped.view(np.float64)
    return wrong


def corrupted_fields(fields: Mapping[str, Any], kind: Marks, bias: Array, draw: Array) -> dict[str, Any]:
    """The named fields (m, ...) of messages as they arrive; only those of floating-point numbers can be wrong.

    Parameters
    ----------
    fields
        Arrays that begin with the messages.
    kind, bias, draw
        As for `corrupted`.
    """
    floating = sorted(name for name, field in fields.items() if field.dtype.kind == "f" and field.size)
    if not floating:
        return dict(fields)
    flat = np.concatenate([fields[name].reshape(len(kind), -1) for name in floating], axis=-1)
    wrong = corrupted(flat, kind, bias, draw)
    ends = np.cumsum([fields[name][0].size for name in floating])[:-1]
    parts = zip(floating, np.split(wrong, ends, axis=-1), strict=True)
    return {**fields, **{name: part.reshape(fields[name].shape) for name, part in parts}}
