"""The numbers of a scenario by what they are: types with their bounds, and times in order."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi
from typing import Annotated

from pydantic import AfterValidator, Field

from affinet.scenario.bounds import LARGEST, LATEST, MOST, SMALLEST

_SHORTEST_TICK = 1e-6


def _not_tiny(value: float) -> float:
    if 0.0 < abs(value) < SMALLEST:
        raise ValueError(f"is too small to tell from 0: should be at least {SMALLEST:g}, got {value:g}")
    return value


def _long_enough(tick: float) -> float:
    if tick < _SHORTEST_TICK:
        raise ValueError(f"should be at least {_SHORTEST_TICK:g}, got {tick:g}")
    return tick


Probability = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False), AfterValidator(_not_tiny)]
Below1 = Annotated[float, Field(ge=0.0, lt=1.0, allow_inf_nan=False), AfterValidator(_not_tiny)]
Positive = Annotated[float, Field(gt=0.0, le=LARGEST, allow_inf_nan=False), AfterValidator(_not_tiny)]
NotNegative = Annotated[float, Field(ge=0.0, le=LARGEST, allow_inf_nan=False), AfterValidator(_not_tiny)]
Moment = Annotated[float, Field(ge=0.0, le=LATEST, allow_inf_nan=False), AfterValidator(_not_tiny)]
Bearing = Annotated[float, Field(gt=0.0, le=pi, allow_inf_nan=False), AfterValidator(_not_tiny)]
ShareOfDistance = Annotated[float, Field(gt=0.0, le=10.0, allow_inf_nan=False), AfterValidator(_not_tiny)]
BitsPerSecond = Annotated[float, Field(gt=0.0, le=1e15, allow_inf_nan=False), AfterValidator(_not_tiny)]
AtLeast1 = Annotated[float, Field(ge=1.0, le=LARGEST, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Rate = Annotated[float, Field(gt=-1.0, lt=10.0, allow_inf_nan=False), AfterValidator(_not_tiny)]
Tick = Annotated[float, Field(gt=0.0, le=100.0, allow_inf_nan=False), AfterValidator(_long_enough)]
Steps = Annotated[int, Field(ge=1, le=MOST)]
Matrix = list[list[Finite]]
Ticks = Annotated[int, Field(ge=0, le=MOST)]


def refuse_unordered(what: str, times: Sequence[float]) -> None:
    """Refuse times that do not increase.

    Raises
    ------
    ValueError
        When one is not later than the one before.
    """
    if any(later <= earlier for earlier, later in pairwise(times)):
        raise ValueError(f"{what} must increase, got {times}")
