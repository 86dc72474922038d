"""Arrays <-> bytes: numbers row by row, nothing around them.

What kind of numbers a field holds, and of what shape, the protocol tells (docs/protocol.md), so a message need not. Nested
lists say the same, more slowly; an agent that is not ours may send those.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from netem.core.plain import shown
from netem.wire.wrong import WireError, Wrong

Packed = bytes | list[Any]  # an array as it travels
Shape = tuple[int, ...]

FLOAT, WHOLE, TRUTH, CODE = np.dtype("<f8"), np.dtype("<i8"), np.dtype("?"), np.dtype("u1")

_TRUTHS = b"\0\1"
_KINDS = {"f": "iuf", "i": "i", "b": "b"}  # of numbers in a list that will do for one


def packed(array: Any, dtype: np.dtype[Any] = FLOAT) -> bytes:
    """An array as it travels."""
    return np.asarray(array, dtype).tobytes()


def numbers(given: Any, whose: str, shape: Shape, dtype: np.dtype[Any] = FLOAT) -> Any:
    """What somebody said as an array, which cannot be written to.

    Parameters
    ----------
    given
        The bytes of an array, a number, or nested lists of numbers.
    whose
        Who said it, and where: how the error begins.
    shape
        What it has to be; any length where it begins with -1.
    dtype
        What it holds.

    Raises
    ------
    WireError
        When it is something else.
    """
    array = _of_bytes(given, shape, dtype) if type(given) is bytes else _of_lists(given, shape, dtype)
    if array is None:
        what = {"b": "truths", "f": "numbers"}.get(dtype.kind, "whole numbers")
        of = ", ".join("any" if length < 0 else str(length) for length in shape)
        got = f"{len(given)} bytes" if type(given) is bytes else shown(given)
        raise WireError(f"{whose}: expected {what} of shape ({of}), got {got} (see docs/protocol.md)", Wrong.SHAPE)
    return array


@dataclass(frozen=True)
class Form:
    """What a named field of a message holds.

    Parameters
    ----------
    shape
        Of the array.
    truths
        Whether it holds truths, and not numbers.
    """

    shape: Shape
    truths: bool

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """What it holds."""
        return TRUTH if self.truths else FLOAT

    @cached_property
    def silence(self) -> bytes:
        """Zeros, as they travel."""
        return bytes(prod(self.shape) * self.dtype.itemsize)

    def holds(self, given: Any) -> bool:
        """Whether something is such an array as bytes."""
        return type(given) is bytes and len(given) == len(self.silence) and not (self.truths and given.strip(_TRUTHS))

    def rows(self, given: Sequence[Any], whose: Iterable[str]) -> Any:
        """What several said in this field, a row each.

        Parameters
        ----------
        given
            As it came.
        whose
            Who said it, and where.

        Raises
        ------
        WireError
            When one is of another form.
        """
        shape = (len(given), *self.shape)
        rows = joined(given, [len(self.silence)] * len(given), shape, self.dtype)
        if rows is None:
            each = [numbers(one, who, self.shape, self.dtype) for one, who in zip(given, whose, strict=True)]
            rows = np.array(each, self.dtype).reshape(shape)
        return rows


def joined(given: Sequence[Any], sizes: Sequence[int], shape: Shape, dtype: np.dtype[Any]) -> Any:
    """The arrays of several as one, if all came as bytes, so many each, and are what they should be; else None."""
    try:
        data = b"".join(given)
    except TypeError:
        return None
    return _of_bytes(data, shape, dtype) if [len(one) for one in given] == sizes else None


def channel_rows(
    forms: Mapping[str, Form], said: Sequence[Mapping[str, Any] | None], whose: Sequence[str]
) -> dict[str, Any]:
    """What several said on one channel: each of its fields, a row each, zeros of those who said nothing.

    Raises
    ------
    WireError
        When a field is missing, or of another form.
    """
    return {
        name: form.rows(
            [form.silence if fields is None else fields.get(name) for fields in said],
            (f"{who}: {name!r}" for who in whose),
        )
        for name, form in forms.items()
    }


def _of_bytes(data: bytes, shape: Shape, dtype: np.dtype[Any]) -> Any:
    if dtype is TRUTH and data.strip(_TRUTHS):
        return None
    try:
        return np.frombuffer(data, dtype).reshape(shape)
    except ValueError:
        return None


def _of_lists(given: Any, shape: Shape, dtype: np.dtype[Any]) -> Any:
    try:
        array = np.array(given)
    except (TypeError, ValueError, OverflowError, RecursionError):
        return None
    if array.shape == (0,) and shape[:1] in {(-1,), (0,)}:
        return np.empty((0, *shape[1:]), dtype)
    if not _fits(array.shape, shape) or (array.dtype.kind not in _KINDS.get(dtype.kind, "") and array.size):
        return None
    array = array.astype(dtype)
    array.flags.writeable = False
    return array


def _fits(shape: Shape, wanted: Shape) -> bool:
    return shape == wanted or (wanted[:1] == (-1,) and len(shape) == len(wanted) and shape[1:] == wanted[1:])
