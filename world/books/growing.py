"""Arrays on disk that grow by rows: `.npy` files of NumPy, whole at every moment, also after a kill at any.

Rows are written first, and only then does the beginning of the file say that they are there. What comes of a power failure
is up to the file system.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from netem.processes import system_errors

ENDING = ".npy"
_IN_MEMORY = 2**24  # bytes up to which an array is read, unless it is wanted mapped; a mapped one takes a descriptor


class GrowingArray:
    """An array that is written while it grows.

    Parameters
    ----------
    path
        Of the file, new.
    form
        Any array whose rows are like its own.

    Raises
    ------
    OSError
        By all its methods: when something cannot be written.
    """

    def __init__(self, path: Path, form: NDArray[Any]) -> None:
        self._path, self._form = path, form[:0]
        self._row = form.dtype.itemsize * int(np.prod(form.shape[1:], dtype=np.int64))
        self._first = len(self._header(0))  # NumPy leaves room for any number of rows
        with system_errors.about(path):
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self.declare(0)

    def write(self, at: int, rows: NDArray[Any]) -> None:
        """Write rows from row `at` on, that nobody sees yet."""
        whole = np.empty((len(rows), *self._form.shape[1:]), self._form.dtype)
        whole[...] = rows
        self._put(whole.reshape(-1).view(np.uint8).data, self._first + at * self._row)

    def declare(self, rows: int) -> None:
        """From now on it has so many rows."""
        self._put(memoryview(self._header(rows)), 0)

    def close(self) -> None:
        """Write no more."""
        os.close(self._file)

    def _put(self, data: memoryview, place: int) -> None:
        with system_errors.about(self._path):
            while data:
                written = os.pwrite(self._file, data, place)
                data, place = data[written:], place + written

    def _header(self, rows: int) -> bytes:
        header = BytesIO()
        shape = (rows, *self._form.shape[1:])
        says = {"descr": npy.dtype_to_descr(self._form.dtype), "fortran_order": False, "shape": shape}
        npy.write_array_header_1_0(header, says)
        return header.getvalue()


def read(path: Path, *, mapped: bool = False) -> NDArray[Any]:
    """An array of a file: one that is large, or is wanted so, is mapped: read where it is looked at, and never written to.

    Raises
    ------
    OSError
        When there is none.
    ValueError
        When it is none, or not whole.
    """
    with path.open("rb") as file:
        if npy.read_magic(file) != (1, 0):
            raise ValueError("it is of another format of NumPy's")
        shape, by_columns, dtype = npy.read_array_header_1_0(file)
        count, begins = int(np.prod(shape, dtype=np.int64)), file.tell()
        if by_columns or dtype.hasobject:
            raise ValueError("it holds no plain rows of numbers")
        if os.fstat(file.fileno()).st_size < begins + count * dtype.itemsize:
            raise ValueError(f"it breaks off before its {shape[:1]} rows end")
        size = count * dtype.itemsize
        if size <= _IN_MEMORY and not mapped:
            return np.fromfile(file, dtype, count).reshape(shape)
        return np.ndarray(shape, dtype, mmap.mmap(file.fileno(), begins + size, access=mmap.ACCESS_READ), begins)


def let_go(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Take no memory for what was read of arrays that are mapped; it is read again where it is looked at again."""
    for array in arrays.values():
        base: Any = array
        while isinstance(base, np.ndarray):
            base = base.base
        if isinstance(base, mmap.mmap):
            base.madvise(mmap.MADV_DONTNEED)
