"""Two runs compared bit by bit: the first thing in which they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.models.arrays import Mask
from netem.core.links import Links
from netem.medium.verdict import Verdict
from world.books import history
from world.books.history import Arrays

_OF_LINKS = ("measured",)
_OF_CHANNELS = ("verdicts", "newest")
# In the order in which a tick makes them, so that a cause is named before what follows from it; what estimators report and the
# input come after.
_MADE = (
    "target",
    "position",
    "error",
    "measured",
    "verdicts",
    "newest",
    "copies",
    "late",
    "dropped",
    "known",
    "estimate",
    "covariance",
    "psi",
    "feasible",
)
_OF_NOBODY = ("error", "copies", "late", "dropped")


@dataclass(frozen=True)
class Difference:
    """Where two runs part.

    Parameters
    ----------
    tick
        The first in which they differ.
    quantity
        The first array in which they do.
    where
        The agent, or the link and channel.
    one, other
        The two values.
    """

    tick: int
    quantity: str
    where: str
    one: str
    other: str

    def __str__(self) -> str:
        at = f" of {self.where}" if self.where else ""
        return f"tick {self.tick}: {self.quantity}{at} is {self.one} in one run and {self.other} in the other"


def first_difference(one: Arrays, other: Arrays, links: Links, channels: Sequence[str]) -> Difference | None:
    """The first difference of two runs over the same links and channels; None when every bit is the same."""
    made = one.keys() | other.keys()
    names = [*(name for name in _MADE if name in made), *sorted(made - {*_MADE, "input"}), "input"]
    for name in names:
        forms = [history.form(arrays.get(name)) for arrays in (one, other)]
        if forms[0] != forms[1]:  # their values cannot be held against each other
            return Difference(0, name, "", *forms)
    parted = [
        (tick, place, name)
        for place, name in enumerate(names)
        if (tick := _first_tick(one[name], other[name])) is not None
    ]
    if not parted:
        return None
    tick, _, name = min(parted)
    if tick >= min(len(one[name]), len(other[name])):
        lengths = [f"{len(arrays['error'])} ticks long" for arrays in (one, other)]
        return Difference(tick, "the run", "", *lengths)
    here, there = one[name][tick : tick + 1], other[name][tick : tick + 1]
    place = tuple(np.argwhere(_unlike(here, there))[0].tolist())
    return Difference(
        tick, name, _where(name, place[1:], links, channels), _said(name, here[place]), _said(name, there[place])
    )


@dataclass(frozen=True)
class Distance:
    """How far apart two runs are that need not be the same, over the ticks that both have flown.

    Parameters
    ----------
    ticks
        How many.
    mean, largest
        Of the distances between an agent in one and in the other, in metres.
    errors
        The mean tracking errors, in square metres.
    verdicts
        Share of the verdicts that are the same.
    """

    ticks: int
    mean: float
    largest: float
    errors: tuple[float, float]
    verdicts: float

    def __str__(self) -> str:
        return (
            f"over {self.ticks} ticks agents are {self.mean:.4g} m apart on average and {self.largest:.4g} m at most; tracking "
            f"error {self.errors[0]:.4g} and {self.errors[1]:.4g} m2; {100 * self.verdicts:.4g} % of the verdicts are the same"
        )


def distance(one: Arrays, other: Arrays) -> Distance | None:
    """How far apart two runs of the same agents and links are; None where one has no tick."""
    if not (ticks := min(len(one["error"]), len(other["error"]))):
        return None
    apart = np.linalg.norm(one["position"][:ticks] - other["position"][:ticks], axis=-1)
    same = one["verdicts"][:ticks] == other["verdicts"][:ticks]
    errors = [float(np.nanmean(arrays["error"][:ticks])) for arrays in (one, other)]
    return Distance(ticks, float(apart.mean()), float(apart.max()), (errors[0], errors[1]), float(same.mean()))


def _first_tick(one: NDArray[Any], other: NDArray[Any]) -> int | None:
    common = min(len(one), len(other))
    unlike = _unlike(one[:common], other[:common])
    in_tick = np.logical_or.reduce(unlike, axis=tuple(range(1, unlike.ndim)))
    if in_tick.any():
        return int(np.argmax(in_tick))
    return None if len(one) == len(other) else common


def _unlike(one: NDArray[Any], other: NDArray[Any]) -> Mask:
    """Where two arrays differ in any bit: a NaN is like itself, and 0.0 is not -0.0."""
    if one.dtype.kind == "f":
        one, other = (history.one_nan(array).view(np.uint64) for array in (one, other))
    unlike: Mask = np.not_equal(one, other)
    return unlike


def _said(name: str, value: Any) -> str:
    return Verdict(value).label if name == "verdicts" else repr(value.item())


def _where(name: str, row: tuple[int, ...], links: Links, channels: Sequence[str]) -> str:
    if name in _OF_LINKS:
        return f"{links.src[row[0]]}->{links.dst[row[0]]}"
    if name in _OF_CHANNELS:
        return f"{channels[row[0]]} on {links.src[row[1]]}->{links.dst[row[1]]}"
    return "" if name in _OF_NOBODY else f"agent {row[0] + 1}"
