"""Compiled kernels on disk: Numba compiles each once on a machine, and later processes load what came of it without Numba.

A kernel is found by all that decides what it is: its code, the constants and parts that it uses, the sizes it is compiled for,
the compiler, and the CPU.
"""

from __future__ import annotations

import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import llvmlite.binding as llvm

from analysis.kernels.kernel import Kernel, Part
from analysis.kernels.machine_code import loaded


def universal(kernel: Kernel, sizes: tuple[int, ...], file: str) -> Callable[..., Any]:
    """The universal function of a kernel for these sizes from this file, compiled now if it never was."""
    path = Path(file)
    try:
        code = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        from analysis.kernels.compiling import object_code  # Numba takes a second

        code = object_code(kernel, sizes)
        _keep(path, code)
    return loaded(kernel, code)


def place(kernel: Kernel, sizes: tuple[int, ...]) -> Path:
    """The file in which this user's processes keep it."""
    return folder() / f"{kernel.name}-{_digest(kernel, sizes)}.o"


def folder() -> Path:
    """Where compiled kernels are kept."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "affinet" / "kernels"


def _keep(path: Path, code: bytes) -> None:
    """Write it whole or not at all: others may do the same at the same time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as unfinished:
            unfinished.write(code)
        Path(unfinished.name).replace(path)
    except OSError as error:
        warnings.warn(
            f"every process compiles its kernels anew, as they cannot be kept in {path.parent} ({error.strerror}):"
            " set XDG_CACHE_HOME to a folder that can be written to",
            stacklevel=2,
        )


def _digest(kernel: Kernel, sizes: tuple[int, ...]) -> str:
    digest = blake2b(digest_size=12)
    for known in (_compiler(), kernel.layout, kernel.types, sizes, *written(kernel.plain(*sizes))):
        digest.update(repr(known).encode() + b"\0")
    return digest.hexdigest()


@cache
def _compiler() -> tuple[str, ...]:
    return (
        version("numba"),
        version("llvmlite"),
        sys.version,
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
    )


def written(plain: Any) -> list[Any]:
    """All that decides what a plain function does: its code, and what it finds about it by name."""
    code, known = plain.__code__, plain.__globals__
    closure = [cell.cell_contents for cell in plain.__closure__ or ()]
    of_names = [_written(known[name]) for name in code.co_names if name in known]
    return [code.co_code, code.co_consts, code.co_names, [_written(held) for held in closure], of_names]


def _written(held: Any) -> Any:
    if isinstance(held, Part):
        return written(held.plain)
    if isinstance(held, FunctionType):
        raise TypeError(f"a kernel calls {held.__qualname__}, which is no Part: only parts are compiled with it")
    return held.__name__ if isinstance(held, ModuleType) else held
