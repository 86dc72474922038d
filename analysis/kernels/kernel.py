"""Kernels: what is computed for one row, as a plain function, and called with arrays of rows.

A kernel is a plain function that fills its last arguments. It is compiled when it is first called, and what comes of that is
kept on disk for the processes to come. Its bits are those of the plain function, number by number: sums are taken in the order
that is written, and no product is fused with a sum, so that they do not depend on the CPU. A row alone and the same row in a
batch go through the same code.

Sizes that are few and small, as the number of dimensions, are constants of what is compiled: loops over them unroll.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import update_wrapper
from typing import Any

import numpy as np

Plain = Callable[..., None]
Factory = Callable[..., Plain]


class Part:
    """A function that kernels call, of numbers and arrays, with or without a result."""

    def __init__(self, plain: Callable[..., Any]) -> None:
        update_wrapper(self, plain)
        self.plain = plain

    def __call__(self, *given: Any) -> Any:
        """As it is written."""
        return self.plain(*given)


@Part
def scratch(rows: int, columns: int) -> Any:
    """Room for numbers that a kernel needs while it works, shape (rows, columns), with anything in it; sizes are constants."""
    return np.empty((rows, columns))


class Kernel:
    """A compiled function over arrays.

    Parameters
    ----------
    factory
        From the sizes that it is compiled for to what it computes for one row: a function that fills its last arguments, as
        many as there are results.
    layout
        The core axes of arguments and results, as those of NumPy's generalised universal functions: "(n,D),(n)->(D,D)". It is
        compiled for each size of the axes in capitals, `sizes`.
    types
        Their types, by NumPy's letters: "d" float64, "?" bool, "l" int64, "L" uint64, "B" uint8;
        "d?->d".
    """

    def __init__(self, factory: Factory, layout: str, types: str) -> None:
        update_wrapper(self, factory)
        self.name = f"{factory.__module__}.{factory.__qualname__}"
        arguments, _, results = layout.partition("->")
        self.factory, self.layout, self.types = factory, layout, types.replace("->", "")
        self.cores = [*_cores(arguments), *_cores(results)]
        self.arguments = len(_cores(arguments))
        self._axes = tuple(map(len, self.cores[: self.arguments]))
        self._sizes = tuple(_capitals(self.cores[: self.arguments]))
        self.sizes = tuple(name for name, _, _ in self._sizes)
        self._compiled: dict[tuple[int, ...], Callable[..., Any]] = {}
        self._files: dict[tuple[int, ...], str] = {}
        _EVERY[f"{self.name} {self.types}"] = self

    def __call__(self, *given: Any) -> Any:
        """What comes of arrays, their leading axes broadcast against each other: an array, or as many as there are results."""
        if len(given) != self.arguments:
            raise TypeError(f"{self.name} takes {self.arguments} arrays, not {len(given)}")
        for axes, array in zip(self._axes, given, strict=True):
            if axes and not array.flags.c_contiguous:
                given = tuple(map(_compact, given, self._axes))
                break
        sizes = tuple([given[place].shape[axis] for _, place, axis in self._sizes])
        compiled = self._compiled.get(sizes) or self.prepare(sizes)
        return compiled(*given)

    def plain(self, *sizes: int) -> Plain:
        """What is compiled for these sizes, in the order in which their axes first appear."""
        return self.factory(*sizes)

    @property
    def prepared(self) -> list[tuple[tuple[int, ...], str]]:
        """The sizes that it is compiled for in this process, and the file of each."""
        return list(self._files.items())

    def prepare(self, sizes: tuple[int, ...], file: str | None = None) -> Callable[..., Any]:
        """Compile it for these sizes, or load what was compiled before, from where this user's are kept or from this file."""
        from analysis.kernels.kept import (
            place,
            universal,  # which loads a compiler's library: who computes nothing need not wait
        )

        self._compiled[sizes], self._files[sizes] = universal(self, sizes, file or str(place(self, sizes)))
        return self._compiled[sizes]


_EVERY: dict[str, Kernel] = {}


def prepared() -> dict[str, list[tuple[tuple[int, ...], str]]]:
    """All kernels that were called in this process, with which sizes, and the file of each."""
    return {name: one.prepared for name, one in _EVERY.items() if one.prepared}


def prepare(wanted: Mapping[str, Sequence[tuple[Sequence[int], str | None]]]) -> None:
    """Make kernels ready, as another process has `prepared` them, if what they are in is imported."""
    for name, many in wanted.items():
        for sizes, file in many if name in _EVERY else ():
            _EVERY[name].prepare(tuple(sizes), file)


def kernel(layout: str, types: str) -> Callable[[Factory], Kernel]:
    """Make a factory of plain functions a `Kernel`."""

    def made(factory: Factory) -> Kernel:
        return Kernel(factory, layout, types)

    return made


def _compact(array: Any, axes: int) -> Any:
    """The array, with its last axes as close together as they can be."""
    if not axes or array.flags.c_contiguous:
        return array
    step = array.itemsize
    for size, stride in zip(array.shape[: -axes - 1 : -1], array.strides[: -axes - 1 : -1], strict=True):
        if stride != step:
            return np.ascontiguousarray(array)
        step *= size
    return array


def _cores(side: str) -> list[list[str]]:
    """The names of the axes of each core of a side of a layout."""
    return [[name.strip() for name in core.split(",") if name.strip()] for core in re.findall(r"\(([^)]*)\)", side)]


def _capitals(cores: list[list[str]]) -> Iterator[tuple[str, int, int]]:
    """Each axis in capitals where it first appears: its name, of which argument it is, and which of its last axes."""
    found = set[str]()
    for place, core in enumerate(cores):
        for axis, name in enumerate(core, start=-len(core)):
            if name.isupper() and name not in found:
                found.add(name)
                yield name, place, axis
