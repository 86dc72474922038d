"""Whether what a user's own code returns is what was asked of it, said in the words of the docs.

These checks run in every tick, so they compare a shape and a dtype each, and look at no number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Shape = tuple[int, ...]
FLOAT, BOOL = np.dtype(np.float64), np.dtype(np.bool_)


class WrongReturn(TypeError):
    """An algorithm returned something else than was asked of it."""


def pair(given: Any, what: str) -> tuple[Any, Any]:
    """The two things that a method has to return."""
    if type(given) is not tuple or len(given) != 2:
        raise WrongReturn(f"must return {what}, got {kind(given)}")
    return given


def array(name: str, value: Any, axes: str, shape: Shape, batch: Shape, dtype: np.dtype[Any] = FLOAT) -> None:
    """Refuse what is no array of this dtype and shape, which begins with the batch axes; `axes` name the others."""
    if is_array(value) and value.shape == (*batch, *shape) and value.dtype == dtype:
        return
    symbols = written(axes.split(", ") if axes else [])
    meant = "" if written(shape) == symbols else f" = {written(shape)}"
    raise WrongReturn(f"{name} must be {dtype} {symbols}{meant}, got {shown(value, batch)}")


def is_array(value: Any) -> bool:
    """Whether it is a plain array, or a number of NumPy: a masked one has places without a number, that no message carries."""
    return type(value) is np.ndarray or isinstance(value, np.generic)


def written(sizes: Sequence[Any]) -> str:
    """A shape (..., *) as people write it."""
    return f"({', '.join(['...', *map(str, sizes)])})"


def shown(value: Any, batch: Shape | None = None) -> str:
    """Dtype and shape of an array, without the batch axes where it has them, or what else a value is."""
    if not is_array(value):
        return kind(value)
    if batch is None or value.shape[: len(batch)] != batch:
        return f"{value.dtype} {value.shape}"
    return f"{value.dtype} {written(value.shape[len(batch) :])}"


def kind(value: Any) -> str:
    """What a value is, for people."""
    if value is None:
        return "None"
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        return f"a tuple of {len(value)}"
    name = type(value).__name__
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"
