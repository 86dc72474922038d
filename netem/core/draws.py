"""Random numbers that are a pure function of what they are for.

One generator, Philox-4x32 with ten rounds, is called with the seed as its key and the *purpose* of the draw as its counter:
which kind of draw, from whom, to whom, on which channel, in which tick. Nothing is drawn in an order, so adding an agent,
a fault or a message moves no other draw, and any draw can be computed again offline.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.kernels.kernel import Part, Plain, kernel
from analysis.models.arrays import Array, Integers

Words = NDArray[np.uint64]
Seed = int | Words  # of one run, or of the run that each row of a batch belongs to

_WORD = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_MULTIPLIERS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_ROUNDS = 10
_MOST_LANES = 2**17  # two to a block, 16 bits for the block


class Purpose(IntEnum):
    """What a draw is for: part of its counter, so no two kinds of draw ever share a number."""

    LOSS = 1
    SENSOR_NOISE = 2
    PROCESS_NOISE = 3
    INITIAL_POSITION = 4
    CHAIN_START = 5
    PACKET_CHAIN = 6
    TRACE = 7
    REACH = 8
    SHADOWING = 9
    JAMMING = 10
    DELAY = 11
    DELAY_START = 12
    DUPLICATE = 13
    CORRUPTION = 14
    CORRUPTED_BIT = 15
    SCRIPTED_LOSS = 16
    DROPOUT = 17
    OUTLIER = 18
    OUTLIER_SIZE = 19
    SELECTION = 20
    TARGET = 21
    LATENCY = 22
    DETECTION = 23
    NAMED = 24
    MISS = 25
    FALSE_POSITIVE = 26
    CLUTTER = 27
    LAYOUT = 28
    TIMER = 29


@Part
def philox(counter: tuple[Words, Words, Words, Words], key: tuple[Words, Words]) -> tuple[Words, Words, Words, Words]:
    """Philox-4x32-10 over 32-bit words held in 64-bit integers, or over arrays of them.

    Parameters
    ----------
    counter, key
        Words below 2**32.

    Returns
    -------
    tuple
        Four 32-bit words per counter.

    References
    ----------
    Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
    """
    x0, x1, x2, x3 = counter
    k0, k1 = key
    for _ in range(_ROUNDS):
        product0, product1 = x0 * _MULTIPLIERS[0], x2 * _MULTIPLIERS[1]
        x0, x1 = (product1 >> _HALF) ^ x1 ^ k0, product1 & _WORD
        x2, x3 = (product0 >> _HALF) ^ x3 ^ k1, product0 & _WORD
        k0, k1 = (k0 + _WEYL[0]) & _WORD, (k1 + _WEYL[1]) & _WORD
    return x0, x1, x2, x3


@Part
def unit(high: Words, low: Words) -> Array:
    """The number in (0, 1) that two 32-bit words stand for, or arrays of them.

    Of 52 bits, and centred in its cell: neither 0 nor 1 can come out, so an inverse distribution function stays finite.
    """
    bits = (high << np.uint64(20)) | (low >> np.uint64(12))
    return (bits * 1.0 + 0.5) * 2.0**-52


@kernel("(),(),(),(),(),(l)->(l)", "LLLLLL->d")
def _drawn() -> Plain:
    def plain(key: int, tick: int, ends: int, channel: int, purpose: int, lanes: Words, drawn: Array) -> None:
        for block in range((len(lanes) + 1) // 2):
            counter = (tick, ends, channel, purpose | np.uint64(block))
            x0, x1, x2, x3 = philox(counter, (key & _WORD, key >> _HALF))
            drawn[2 * block] = unit(x0, x1)
            if 2 * block + 1 < len(lanes):
                drawn[2 * block + 1] = unit(x2, x3)

    return plain


def uniform(
    seed: Seed,
    purpose: Purpose | str,
    *,
    tick: ArrayLike = 0,
    src: ArrayLike = 0,
    dst: ArrayLike = 0,
    channel: ArrayLike = 0,
    lanes: int = 1,
) -> Array:
    """Uniform draws in the open interval (0, 1), one row of `lanes` per broadcast (tick, src, dst, channel).

    Parameters
    ----------
    seed
        Of the run, in [0, 2**64); of many runs, an array that broadcasts against the indices.
    purpose
        What the draws are for: one of ours, or the name of what a user's own code draws for.
    tick, channel
        Integers below 2**32.
    src, dst
        Agent numbers below 2**16.
    lanes
        How many independent draws each index gets, at most 2**17.

    Returns
    -------
    Array
        Shape (..., lanes).

    Raises
    ------
    ValueError
        When an index does not fit its words, or there are too many lanes: two indices would share one draw.
    """
    if not 0 < lanes <= _MOST_LANES:
        raise ValueError(f"lanes must lie in [1, 2**17], got {lanes}")
    if isinstance(seed, int) and not 0 <= seed < 2**64:
        raise ValueError(f"seed {seed} is outside [0, 2**64)")
    ticks, channels = _words("tick", tick, 32), _words("channel", channel, 32)
    sources, targets = _words("src", src, 16), _words("dst", dst, 16)
    keys, word = np.asarray(seed, dtype=np.uint64), Purpose.NAMED
    if isinstance(purpose, Purpose):
        word = purpose
    else:  # names have no number in the counter: each has a key of its own
        keys = keys ^ np.uint64(int.from_bytes(blake2b(purpose.encode(), digest_size=8).digest(), "little"))
    ends = sources << np.uint64(16) | targets
    drawn: Array = _drawn(keys, ticks, ends, channels, np.uint64(int(word) << 16), np.empty(lanes, dtype=np.uint64))
    return drawn


def _words(name: str, value: ArrayLike, bits: int) -> Words:
    array = np.asarray(value)
    if array.size and (array.min() < 0 or int(array.max()) >> bits):
        raise ValueError(f"{name} must lie in [0, 2**{bits}) to index a draw, got {array.min()} to {array.max()}")
    return array.astype(np.uint64)


class DrawnAhead:
    """Draws of a span of ticks computed at once and read tick by tick: the same numbers, a fraction of the cost."""

    def __init__(self, draw: Callable[[Integers], NDArray[Any]], span: int = 64) -> None:
        """`draw` maps ticks (T,) to draws (T, ...) and must be pure."""
        self._draw = draw
        self._span = span
        self._block = -1
        self._rows: NDArray[Any] = np.empty(0)

    def at(self, tick: int) -> NDArray[Any]:
        """The draws of one tick."""
        block, row = divmod(tick, self._span)
        if block != self._block:
            self._rows = self._draw(np.arange(block * self._span, (block + 1) * self._span))
            self._block = block
        row_of_tick: NDArray[Any] = self._rows[row]
        return row_of_tick
