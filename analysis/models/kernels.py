"""Functions of one agent, link or edge, compiled, which broadcast over any leading axes.

A kernel is a plain function that fills its last arguments. Numba compiles it when it is first called, and what it compiles is
kept on disk for the processes to come. Its bits are those of the plain function, number by number: sums are taken in the order
that is written, and no product is fused with a sum, so that they do not depend on the CPU. A row alone and the same row in a
batch go through the same code.

Sizes that are few and small, as the number of dimensions, are constants of what is compiled: loops over them unroll.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from functools import cache, cached_property, update_wrapper
from hashlib import blake2b
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from analysis.models.arrays import Array

_ROOMS = ("agents", "analysis", "netem", "world")
_HOUSE = Path(__file__).parents[2]
_ROOM = 81  # numbers
_MARK = b"analysis.models.kernels import"

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

    @cached_property
    def compiled(self) -> Any:
        """For kernels."""
        return _numba().njit(error_model="numpy")(_bound(self.plain))


class Scratch(Part):
    """Room for a few numbers that a kernel needs while it works: shape (rows, columns), of sizes that it is compiled for."""

    def __init__(self) -> None:
        super().__init__(_room)

    @cached_property
    def compiled(self) -> Any:
        """On the stack: memory of its own would take as long as the work of a small kernel."""
        numba = _numba()
        number, size = numba.types.float64, numba.types.intp

        @numba.extending.intrinsic  # type: ignore[untyped-decorator]
        def room(_: Any, rows: Any, columns: Any) -> Any:
            array = numba.types.Array(number, 2, "C")

            def generate(context: Any, builder: Any, signature: Any, sizes: Any) -> Any:
                whole = zip(sizes, signature.args, strict=True)
                shape = [context.cast(builder, each, kind, size) for each, kind in whole]
                width = context.get_constant(size, 8)
                room = context.make_array(array)(context, builder)
                numba.np.arrayobj.populate_array(
                    room,
                    data=numba.core.cgutils.alloca_once(builder, context.get_value_type(number), size=_ROOM),
                    shape=shape,
                    strides=[builder.mul(shape[1], width), width],
                    itemsize=width,
                    meminfo=None,
                )
                return room._getvalue()

            return array(rows, columns), generate

        return room


def _numba() -> Any:
    import numba  # takes half a second, which who only reads a help text need not wait for
    import numba.core.cgutils
    import numba.extending
    import numba.np.arrayobj

    return numba


def _room(rows: int, columns: int) -> Array:
    return np.empty((rows, columns))


scratch = Scratch()


class Kernel:
    """A compiled function over arrays.

    Parameters
    ----------
    factory
        From the sizes that it is compiled for to what it computes for one row: a function that fills its last arguments, as
        many as there are results.
    layout
        The core axes of arguments and results, as those of NumPy's generalised universal functions: "(n,D),(n)->(D,D)". It is
        compiled for each size of the axes in capitals.
    types
        Their types, by NumPy's letters: "d" float64, "?" bool, "l" int64, "L" uint64; "d?->d".
    """

    def __init__(self, factory: Factory, layout: str, types: str) -> None:
        update_wrapper(self, factory)
        arguments, _, results = layout.partition("->")
        self.factory, self.layout, self.types = factory, layout, types
        self._arguments, self._cores = len(_cores(arguments)), [*_cores(arguments), *_cores(results)]
        self._sizes = tuple(_capitals(self._cores[: self._arguments]))
        self._axes = tuple(map(len, self._cores[: self._arguments]))
        self._compiled: dict[tuple[int, ...], Callable[..., Any]] = {}

    def __call__(self, *given: Any) -> Any:
        """What comes of arrays, their leading axes broadcast against each other: an array, or as many as there are results."""
        for axes, array in zip(self._axes, given, strict=True):
            if axes and not array.flags.c_contiguous:
                given = tuple(map(_compact, given, self._axes))
                break
        sizes = tuple([given[place].shape[axis] for place, axis in self._sizes])
        compiled = self._compiled.get(sizes) or self._compile(sizes)
        with np.errstate(all="ignore"):  # compilers also compute what is not chosen then
            return compiled(*given)

    def plain(self, *sizes: int) -> Plain:
        """What is compiled for these sizes, in the order in which their axes first appear."""
        return self.factory(*sizes)

    def _compile(self, sizes: tuple[int, ...]) -> Callable[..., Any]:
        numba = _numba()
        numba.config.CACHE_DIR = str(_kept())
        make = numba.guvectorize([self._signature()], self.layout, nopython=True, cache=True)
        compiled = make(_bound(self.factory(*sizes)))
        compiled.build_ufunc()
        self._compiled[sizes] = compiled.ufunc  # what Numba wraps it in takes as long to call as a small kernel
        return self._compiled[sizes]

    def _signature(self) -> Any:
        numba, arguments = _numba(), []
        for place, (letter, core) in enumerate(zip(self.types.replace("->", ""), self._cores, strict=True)):
            kind, result = numba.from_dtype(np.dtype(letter)), place >= self._arguments
            # A single number that comes out is filled in as one of an array.
            axes = max(len(core), 1) if result else len(core)
            arguments.append(numba.types.Array(kind, axes, "A" if result else "C") if axes else kind)
        return numba.void(*arguments)


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


def _capitals(cores: list[list[str]]) -> Iterator[tuple[int, int]]:
    """Each axis in capitals where it first appears: of which argument it is, and which of its last axes."""
    found = set[str]()
    for place, core in enumerate(cores):
        for axis, name in enumerate(core, start=-len(core)):
            if name.isupper() and name not in found:
                found.add(name)
                yield place, axis


def _bound(plain: Any) -> FunctionType:
    """A function with the parts that it calls compiled."""
    known = plain.__globals__
    parts = {name: known[name].compiled for name in _names(plain.__code__) if isinstance(known.get(name), Part)}
    bound = FunctionType(plain.__code__, {**known, **parts}, plain.__name__, plain.__defaults__, plain.__closure__)
    bound.__qualname__, bound.__module__ = plain.__qualname__, plain.__module__
    return bound


def _names(code: Any) -> tuple[str, ...]:
    names: tuple[str, ...] = code.co_names
    return names


@cache
def _kept() -> Path:
    """Where compiled kernels are: a folder for each state of the files that kernels and their parts are in."""
    digest = blake2b(digest_size=8)
    for file in sorted(file for room in _ROOMS for file in (_HOUSE / room).rglob("*.py")):
        if _MARK in (text := file.read_bytes()):
            digest.update(text)
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "affinet" / "kernels" / digest.hexdigest()
