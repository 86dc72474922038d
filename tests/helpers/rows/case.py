"""A function of a batch, and of each of its rows alone: the same bits."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

SIZES = (1, 2, 3, 5, 7, 8, 9, 17)  # one, and what is left over when numbers are taken by twos, fours and eights


@dataclass(frozen=True)
class Argument:
    """What is drawn for it: of which shape for one row, and on which axis the rows stand."""

    make: Callable[[np.random.Generator, tuple[int, ...]], Any]
    shape: tuple[int, ...]
    axis: int

    def draw(self, rng, rows):
        return self.make(rng, (*self.shape[: self.axis], rows, *self.shape[self.axis :]))


def real(*shape, axis=0):
    return Argument(lambda rng, size: 3.0 * rng.normal(size=size), shape, axis)


def share(*shape, axis=0):
    return Argument(lambda rng, size: rng.uniform(1e-9, 1.0, size), shape, axis)


def whole(below, *shape, axis=0):
    return Argument(lambda rng, size: rng.integers(0, below, size), shape, axis)


def truth(*shape, axis=0, p=0.7):
    return Argument(lambda rng, size: rng.random(size) < p, shape, axis)


def covariance(*shape, axis=0):
    """Symmetric, positive definite in the last two axes."""

    def make(rng, size):
        root = rng.normal(size=size)
        return root @ np.swapaxes(root, -1, -2) + 0.5 * np.eye(size[-1])

    return Argument(make, shape, axis)


@dataclass(frozen=True)
class Case:
    """A function, its arguments for one row, how many rows at most, and on which axis of each result they stand."""

    call: Callable[..., Any]
    arguments: tuple[Argument, ...]
    rows: int = SIZES[-1]
    out: int | tuple[int, ...] = 0


def of(call, *arguments, rows=SIZES[-1], out=0):
    return Case(call, arguments, rows, out)


def leaves(value: Any) -> Iterator[np.ndarray]:
    """Every array in a result, in order."""
    if isinstance(value, Mapping):
        value = [value[name] for name in sorted(value)]
    if hasattr(value, "__dataclass_fields__"):
        value = [getattr(value, name) for name in value.__dataclass_fields__]
    if isinstance(value, tuple | list):
        for entry in value:
            yield from leaves(entry)
    elif value is not None:
        yield np.asarray(value)


def _every_other(array, axis):
    wide = np.repeat(array, 2, axis=axis)
    return wide[(slice(None),) * axis + (slice(None, None, 2),)]


def _apart(array, axis):  # noqa: ARG001
    return np.repeat(array, 2, axis=-1)[..., ::2]


def _rows_innermost(array, axis):
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(array, axis, -1)), -1, axis)


LAYOUTS = {
    "contiguous": lambda array, axis: array,  # noqa: ARG005
    "every other row": _every_other,
    "numbers apart": _apart,
    "rows innermost": _rows_innermost,
}


def parted(name: str, case: Case) -> list[str]:
    """In which sizes and layouts a batch parts from its rows alone."""
    rng = np.random.default_rng(crc32(name.encode()))
    drawn = [argument.draw(rng, case.rows) for argument in case.arguments]
    axes = [argument.axis for argument in case.arguments]
    numbers = [
        _alone(case, [np.take(array, row, axis) for array, axis in zip(drawn, axes, strict=True)])
        for row in range(case.rows)
    ]
    found = []
    for row, bits in enumerate(numbers):
        arrays = [np.asarray(np.take(array, row, axis)) for array, axis in zip(drawn, axes, strict=True)]
        if _alone(case, arrays) != bits:
            found.append(f"row {row} as arrays without axes")
    for size in sorted({*SIZES, case.rows}):
        if size > case.rows:
            continue
        first = [np.take(array, range(size), axis) for array, axis in zip(drawn, axes, strict=True)]
        for layout, laid in LAYOUTS.items():
            given = [laid(array, axis) for array, axis in zip(first, axes, strict=True)]
            together = list(leaves(case.call(*given)))
            outs = case.out if isinstance(case.out, tuple) else (case.out,) * len(together)
            for row in range(size):
                if [_bits(np.take(leaf, row, out)) for leaf, out in zip(together, outs, strict=True)] != numbers[row]:
                    found.append(f"row {row} of {size}, {layout}")
                    break
    return found


def _alone(case, arguments):
    return [_bits(leaf) for leaf in leaves(case.call(*arguments))]


def _bits(array):
    array = np.asarray(array)
    return array.shape, array.dtype.str, np.ascontiguousarray(array).tobytes()
