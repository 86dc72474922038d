"""Where an axis has its numbers: round ones, a few of them."""

from __future__ import annotations

import math
from collections.abc import Iterator

_MOST = 6
_ROUND = (1.0, 2.0, 5.0, 10.0)


def of(low: float, high: float) -> list[tuple[float, str]]:
    """Round numbers from `low` to `high`, with how they are said."""
    step = step_of((high - low) / _MOST)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [(number * step, f"{number * step:.10g}") for number in range(first, last + 1)]


def decades(low: float, high: float) -> list[tuple[float, str]]:
    """Powers of ten from 10^low to 10^high as their exponents, and how they are said; of few also twice and five times them."""
    factors = (1.0,) if high - low > 3.0 else (1.0, 2.0, 5.0)
    every = math.ceil((high - low) / _MOST)
    found = [one for one in _between(low, high, factors) if len(factors) > 1 or round(one[0]) % max(every, 1) == 0]
    return found or [(end, f"{10.0**end:.3g}") for end in (low, high)]


def step_of(least: float) -> float:
    """The smallest of 1, 2 or 5 times a power of ten that is no smaller than this."""
    ten = 10.0 ** math.floor(math.log10(least))
    return next(factor * ten for factor in _ROUND if factor * ten >= least * (1.0 - 1e-9))


def _between(low: float, high: float, factors: tuple[float, ...]) -> Iterator[tuple[float, str]]:
    for power in range(math.floor(low), math.ceil(high) + 1):
        for factor in factors:
            at = power + math.log10(factor)
            if low - 1e-9 <= at <= high + 1e-9:
                yield at, f"{factor * 10.0**power:.3g}"
