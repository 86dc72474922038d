"""Which plans can fly side by side: those that differ only in what links have each for itself.

Nothing is the same unless it is known how to compare it, and it is: a field that a plan is given one day counts at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from affinet.planning.plan import Plan
from netem.impairments.profile import Profile

# Of a plan: the scenario is compared apart, the profiles too, and what was found in planning flies nowhere.
_APART = frozenset({"scenario", "profiles", "findings", "faults", "world"})
# Each run has its own draws, and its own faults: both are laid over the links and agents of it alone.
_SEED = frozenset({"run_seed"})
# Of a scenario: what becomes of the network is the air, and how late messages may be, which both briefs say.
_OF_A_RUN = frozenset({"network", "seed", "timeline"})
# Of a profile: one figure, or one row, for each link; chains, with whatever states, are laid over all links.
BY_LINK = frozenset({"chains", "duplicate", "reorder", "corrupt", "bias"})
_ROWS = frozenset({"rows"})
_OF_SOME_LINKS = frozenset({"own", "delays"})

_PLAIN = (str, bytes, int, Enum, Path)


def alike(one: Plan, other: Plan) -> bool:
    """Whether runs of both can fly side by side, if those of each can."""
    return (
        _same_but(_APART, one, other)
        and _same_but(_SEED, one.world, other.world)
        and _same_but(_OF_A_RUN, one.scenario, other.scenario)
        and len(one.profiles) == len(other.profiles)
        and all(map(_alike_airs, one.profiles, other.profiles))
    )


def same(one: Any, other: Any) -> bool:
    """Whether two values are the same, bit for bit; what nobody knows how to compare is the same as itself alone."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return _form(one) == _form(other) and not one.dtype.hasobject and one.tobytes() == other.tobytes()
    if isinstance(one, float):
        return one.hex() == other.hex()
    if isinstance(one, _PLAIN):
        return bool(one == other)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, Mapping):
        return [*one] == [*other] and all(same(one[key], other[key]) for key in one)
    if is_dataclass(one) or isinstance(one, BaseModel):
        return _same_but(frozenset(), one, other)
    return False


def _alike_airs(one: Profile, other: Profile) -> bool:
    return _same_but(BY_LINK | _OF_SOME_LINKS, one, other) and all(
        len(getattr(one, name)) == len(getattr(other, name))
        and all(_same_but(_ROWS, *both) for both in zip(getattr(one, name), getattr(other, name), strict=True))
        for name in _OF_SOME_LINKS
    )


def _same_but(but: frozenset[str], one: Any, other: Any) -> bool:
    """Whether two of a kind are the same in all their fields but these."""
    return type(one) is type(other) and all(
        same(getattr(one, name), getattr(other, name)) for name in _names(one) if name not in but
    )


def _names(one: Any) -> Iterator[str]:
    if isinstance(one, BaseModel):
        return iter(type(one).model_fields)
    return (field.name for field in fields(one))


def _form(array: np.ndarray[Any, Any]) -> tuple[str, tuple[int, ...]]:
    return array.dtype.str, array.shape
