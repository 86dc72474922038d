"""Whether what an algorithm returns is what was asked of it: kinds, shapes and dtypes, said in the words of the docs.

These checks run in every tick, so they compare a shape and a dtype each, and look at no number.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import prod
from types import MappingProxyType
from typing import Any, NoReturn

import numpy as np

from agents.estimate import Estimate
from agents.exchange import Channels, Field, Fields
from netem.core import channels
from netem.loading.given import protect
from netem.loading.returned import BOOL, FLOAT, Shape, WrongReturn, array, is_array, kind, shown, written

_NUMBERS = "biuf"
_WIDEST = 8  # bytes of a number that a message can carry
_MOST_AXES, _MOST_NUMBERS, _MOST_CHANNELS = 8, 65536, 100
_RESERVED = frozenset({channels.SENSE, channels.MEASUREMENT, channels.INPUT, channels.CENTRE})


def declared(given: Any) -> Channels:
    """The channels that an estimator declares, if they can be flown."""
    if not isinstance(given, Mapping):
        raise WrongReturn(f"must return a map from channels to their fields, got {kind(given)}")
    if len(given) > _MOST_CHANNELS:
        raise WrongReturn(
            f"must return at most {_MOST_CHANNELS} channels, as all speak in every tick, got {len(given)}"
        )
    for channel, fields in given.items():
        if not isinstance(channel, str):
            raise WrongReturn(f"a channel is called by a text, not {channel!r}")
        try:
            channels.check(channel)
        except ValueError as error:
            raise WrongReturn(str(error)) from error
        if channel in _RESERVED:
            raise WrongReturn(f"channel {channel!r} is the swarm's own: give it another name")
        if not isinstance(fields, Mapping) or not fields:
            raise WrongReturn(f"channel {channel!r} must be a map from names to Field(shape), got {kind(fields)}")
        for name, field in fields.items():
            if not isinstance(name, str) or not name.isidentifier():
                raise WrongReturn(f"a field of channel {channel!r} is called by a name like 'place', not {name!r}")
            _declared(f"{channel}.{name}", field)
    return given


def _declared(name: str, field: Any) -> None:
    if not isinstance(field, Field):
        raise WrongReturn(f"{name} must be a Field(shape), or Field(shape, bool), got {kind(field)}")
    if not isinstance(field.shape, tuple) or not all(type(size) is int and size >= 1 for size in field.shape):
        raise WrongReturn(f"{name} must have a shape like (2, 2), a tuple of whole numbers from 1, got {field.shape!r}")
    _refuse_too_much(name, field.shape)
    if field.dtype not in (float, np.float64, bool, np.bool_):
        raise WrongReturn(f"{name} holds numbers (float) or truths (bool), got {field.dtype!r}")


def _refuse_too_much(name: str, shape: Shape) -> None:
    if len(shape) > _MOST_AXES or prod(shape) > _MOST_NUMBERS:
        most = f"at most {_MOST_AXES} axes and {_MOST_NUMBERS} numbers"
        raise WrongReturn(f"{name} must have {most}, as it is sent in every tick, got {shape!r}")


def fresh(given: Any, batch: Shape, name: str = "the state") -> None:
    """Refuse a first state that is no NamedTuple of arrays that begin with the batch axes, or of such NamedTuples."""
    if isinstance(given, tuple) and hasattr(given, "_fields"):
        for field, part in zip(given._fields, given, strict=True):
            fresh(part, batch, f"{name}.{field}")
    elif not is_array(given) or given.dtype.kind not in _NUMBERS or given.shape[: len(batch)] != batch:
        what = "a NamedTuple of arrays" if name == "the state" else "an array of numbers or truths"
        raise WrongReturn(f"{name} must be {what} that begins with the batch axes, got {shown(given, batch)}")


def state(before: Any, given: Any, batch: Shape) -> None:
    """Refuse a state that has not the form of the state before it; nobody can write to one that has, from now on."""
    if not _kept(before, given):
        _refuse(before, given, batch, "the state")


def _kept(before: Any, given: Any) -> bool:
    if given is before:
        return True
    if isinstance(before, tuple):
        return type(given) is type(before) and all(map(_kept, before, given))
    if not is_array(given) or given.shape != before.shape or given.dtype != before.dtype:
        return False
    protect(given)
    return True


def _refuse(before: Any, given: Any, batch: Shape, name: str) -> NoReturn:
    """What of the state it is that has another form."""
    if not isinstance(before, tuple):
        raise WrongReturn(f"{name} must stay what it was, {shown(before, batch)}, got {shown(given, batch)}")
    if type(given) is not type(before):
        raise WrongReturn(f"{name} must be a {type(before).__name__}, as before, got {shown(given, batch)}")
    parts = zip(before._fields, before, given, strict=True)  # type: ignore[attr-defined]
    field, old, new = next(part for part in parts if not _kept(*part[1:]))
    _refuse(old, new, batch, field if name == "the state" else f"{name}.{field}")


def said(wanted: Channels, given: Any, batch: Shape) -> Mapping[str, Fields]:
    """What is to be broadcast, if it is what was declared."""
    if not isinstance(given, Mapping):
        raise WrongReturn(f"what to broadcast must be a map from channels to their fields, got {kind(given)}")
    if given.keys() != wanted.keys():
        _differ("what to broadcast", "channels", wanted, given)
    for channel, fields in wanted.items():
        told = given[channel]
        if not isinstance(told, Mapping) or told.keys() != fields.keys():
            _differ(f"what to broadcast on {channel!r}", "fields", fields, told)
        for name, field in fields.items():
            value, dtype = told[name], BOOL if _is_truth(field) else FLOAT
            if type(value) is not np.ndarray or value.shape != batch + field.shape or value.dtype != dtype:
                array(f"{channel}.{name}", value, ", ".join(map(str, field.shape)), field.shape, batch, dtype)
    return given


def estimate(given: Any, slots: int, dimension: int, batch: Shape, reports: Mapping[str, Shape] | None) -> Estimate:
    """An estimate of n slots, if it is one and its reports have the shapes known of them; nobody writes to it from now on."""
    if not isinstance(given, Estimate):
        raise WrongReturn(f"must return an Estimate, got {kind(given)}")
    edges = (slots, dimension)
    array("relative", given.relative, "n, D", edges, batch)
    array("known", given.known, "n", (slots,), batch, BOOL)
    array("covariance", given.covariance, "n, D, D", (*edges, dimension), batch)
    array("psi", given.psi, "", (), batch)
    if given.relative_velocity is not None:
        array("relative_velocity", given.relative_velocity, "n, D", edges, batch)
    if given.feasible is not None:
        array("feasible", given.feasible, "", (), batch, BOOL)
    _reports(given.reports, batch, reports)
    protect(given)
    return given if type(given.reports) is MappingProxyType else given._replace(reports=MappingProxyType(given.reports))


def _reports(given: Any, batch: Shape, wanted: Mapping[str, Shape] | None) -> None:
    if not isinstance(given, Mapping):
        raise WrongReturn(f"reports must be a map from names to arrays, got {kind(given)}")
    if wanted is not None and given.keys() != wanted.keys():
        _differ("reports", "names", wanted, given)
    for name, value in given.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise WrongReturn(f"a report is called by a name like 'place', not {name!r}")
        numbers = is_array(value) and value.dtype.kind in _NUMBERS and value.dtype.itemsize <= _WIDEST
        if not numbers or value.shape[: len(batch)] != batch:
            raise WrongReturn(
                f"report {name!r} must be an array of numbers (..., *) of at most 64 bits, got {shown(value, batch)}"
            )
        shape = value.shape[len(batch) :]
        if wanted is None:
            _refuse_too_much(f"report {name!r}", shape)
            if not prod(shape):
                raise WrongReturn(f"report {name!r} must have a number at least, got {shown(value, batch)}")
        elif shape != wanted[name]:
            was = written(wanted[name])
            raise WrongReturn(f"report {name!r} must stay what it was, {was}, got {shown(value, batch)}")


def _is_truth(field: Field) -> bool:
    return field.dtype in (bool, np.bool_)


def _differ(what: str, of: str, wanted: Mapping[str, Any], given: Any) -> NoReturn:
    if not isinstance(given, Mapping):
        raise WrongReturn(f"{what} must be a map, got {kind(given)}")
    raise WrongReturn(f"{what} must have the {of} {sorted(wanted)}, got {sorted(map(str, given))}")
