"""Compiled kernels on disk: Numba compiles each once on a machine, and later processes load what came of it without Numba.

A kernel is found by all that decides what it is: its code, the constants and parts that it uses, the sizes it is compiled for,
the compiler, and the CPU.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from dis import get_instructions
from functools import cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from analysis.kernels.kernel import Kernel, Part
from analysis.kernels.machine_code import loaded

_SEAL = 16  # bytes


def universal(kernel: Kernel, sizes: tuple[int, ...], file: str) -> tuple[Callable[..., Any], str]:
    """The universal function of a kernel for these sizes from this file, compiled now if it never was; and where it is kept."""
    code = _read(file)
    if code is None:
        from analysis.kernels.compiling import object_code  # Numba takes a second

        code = object_code(kernel, sizes)
        file = _keep(Path(file), code + _seal(code))
    return loaded(kernel, code), file


def place(kernel: Kernel, sizes: tuple[int, ...]) -> Path:
    """The file in which this user's processes keep it."""
    return folder() / f"{kernel.name}-{_digest(kernel, sizes)}.o"


def folder() -> Path:
    """Where compiled kernels are kept."""
    try:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:  # neither HOME nor the system says where: as in containers that run under any number of a user
        caches = Path(os.devnull)  # in which nobody can keep anything: it is said, with the way out
    return caches / "affinet" / "kernels"


def _read(file: str) -> bytes | None:
    """The code in a file, if it is all there: a file that a power failure cut short would crash whoever runs it."""
    try:
        written = Path(file).read_bytes()
    except OSError:
        return None
    code, seal = written[:-_SEAL], written[-_SEAL:]
    return code if seal == _seal(code) else None


def _seal(code: bytes) -> bytes:
    return blake2b(code, digest_size=_SEAL).digest()


def _keep(path: Path, content: bytes) -> str:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(path, content)
    except OSError as error:
        _warn_of(str(path.parent), error.strerror)
        return _in_memory(path.name, content)
    return str(path)


def _write(path: Path, content: bytes) -> None:
    """Whole or not at all: others may do the same at the same time."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as unfinished:
        try:
            unfinished.write(content)
            unfinished.flush()
        except OSError:  # the disk is full
            Path(unfinished.name).unlink()
            raise
    Path(unfinished.name).replace(path)


@cache
def _warn_of(folder: str, reason: str) -> None:
    warnings.warn(
        f"every command compiles its kernels anew, as they cannot be kept in {folder} ({reason}):"
        " set XDG_CACHE_HOME to a folder that can be written to",
        stacklevel=2,
    )


def _in_memory(name: str, content: bytes) -> str:
    """A file for those processes that this one starts, which need not compile it as well; it goes with this process."""
    descriptor = os.memfd_create(name)
    with open(descriptor, "wb", closefd=False) as file:
        file.write(content)
    return f"/proc/{os.getpid()}/fd/{descriptor}"


def _digest(kernel: Kernel, sizes: tuple[int, ...]) -> str:
    digest = blake2b(digest_size=12)
    for known in (_compiler(), kernel.layout, kernel.types, sizes, *written(kernel.plain(*sizes))):
        digest.update(repr(known).encode() + b"\0")
    return digest.hexdigest()


@cache
def _compiler() -> tuple[str, ...]:
    return (
        *map(version, ("numba", "llvmlite", "numpy")),
        sys.version,
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
    )


def written(plain: Any) -> list[Any]:
    """All that decides what a plain function does: its code, and what it finds about it by name.

    Raises
    ------
    TypeError
        When it holds what may change without anybody noticing here, or what compiled code cannot do.
    """
    code, known = plain.__code__, plain.__globals__
    if plain.__defaults__ or plain.__kwdefaults__:
        raise TypeError(f"a kernel has no defaults: {plain.__qualname__} has")
    if any(step.opname == "RAISE_VARARGS" for step in get_instructions(code)):
        raise TypeError(f"a kernel raises nothing, as nobody would hear of it: {plain.__qualname__} does")
    closure = [cell.cell_contents for cell in plain.__closure__ or ()]
    of_names = [_written(known[name]) for name in code.co_names if name in known]
    constants = [_code(one) if isinstance(one, CodeType) else one for one in code.co_consts]
    return [code.co_code, constants, code.co_names, [_written(held) for held in closure], of_names]


def _code(code: CodeType) -> list[Any]:
    """Of a function within it, whatever address it has."""
    return [code.co_code, [_code(one) if isinstance(one, CodeType) else one for one in code.co_consts], code.co_names]


def _written(held: Any) -> Any:
    if isinstance(held, Part):
        return written(held.plain)
    if isinstance(held, FunctionType):
        raise TypeError(f"a kernel calls {held.__qualname__}, which is no Part: only parts are compiled with it")
    if held is np or held is math:
        return held.__name__  # whose version is known
    if isinstance(held, np.ndarray):
        return [held.dtype.str, held.shape, held.tobytes()]
    if isinstance(held, tuple):
        return [_written(one) for one in held]
    if isinstance(held, (bool, int, float, np.generic)):
        return [type(held).__name__, held]
    raise TypeError(f"a kernel holds {held!r}: give it numbers, arrays of them, and parts")
