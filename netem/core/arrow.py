"""Tables streamed to disk as Arrow, a batch at a time, in parts; what a killed run has written can be read."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from analysis.models.arrays import Integers, Mask
from netem.core.parts import part, parts
from netem.core.plain import to_plain

Names = Sequence[str] | NDArray[np.str_]

_NOTE = b"note"
LARGEST = 2**26  # bytes, after which the next part begins
NAMES = pa.dictionary(pa.int8(), pa.string())


class TableError(ValueError):
    """A file that is no such table."""


class _WithoutPandas:
    def find_spec(self, name: str, *_: Any) -> None:
        """None, "look elsewhere", but for what is not to be found."""
        if name == "pandas":
            raise ModuleNotFoundError("this process does without pandas")


def do_without_pandas() -> None:
    """Keep Arrow from importing pandas at its first array, where it is installed: that takes longer than to start a swarm.

    For a process that is ours alone: in it, no array is made of a series of pandas any more.
    """
    finder = _WithoutPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.array([])  # Arrow looks for it once
    finally:
        sys.meta_path.remove(finder)


class Stream:
    """Writes a table, in parts each of which is a table by itself.

    Parameters
    ----------
    path
        Of the first part.
    schema
        Of the table.
    """

    def __init__(self, path: Path, schema: Any) -> None:
        self._path, self._schema, self._parts = path, schema, 0
        self._begin()

    def write(self, columns: Mapping[str, Any], note: Any = None) -> None:
        """More rows, as a column for each name of the schema; and a note about the table so far, of plain values."""
        if self._sink.tell() >= LARGEST:
            self.close()
            self._begin()
        arrays = [
            column if isinstance(column, pa.Array) else pa.array(column, self._schema.field(name).type)
            for name, column in columns.items()
        ]
        beside = None if note is None else {_NOTE: json.dumps(to_plain(note))}
        self._stream.write_batch(pa.record_batch(arrays, schema=self._schema), custom_metadata=beside)

    def close(self) -> None:
        """End the file."""
        self._stream.close()
        self._sink.close()

    def _begin(self) -> None:
        self._parts += 1
        self._sink = pa.OSFile(str(part(self._path, self._parts)), "wb")
        options = pa.ipc.IpcWriteOptions(compression="zstd")
        self._stream = pa.ipc.new_stream(self._sink, self._schema, options=options)


def named(index: Integers, names: Names, absent: Mask | None = None) -> Any:
    """A column of names, given by their places."""
    return pa.DictionaryArray.from_arrays(pa.array(index, pa.int8(), mask=absent), pa.array(list(names)))


def places(column: Any, names: Names) -> Integers:
    """Place of each value of a column among the names, -1 for none of them."""
    place = {name: n for n, name in enumerate(names)}
    indices = []
    for chunk in column.chunks:
        lookup = np.array([place.get(name, -1) for name in chunk.dictionary.to_pylist()] + [-1], dtype=np.int64)
        indices.append(lookup[chunk.indices.fill_null(len(lookup) - 1).to_numpy()])
    return np.concatenate(indices) if indices else np.empty(0, dtype=np.int64)


def read(path: Path, schema: Any) -> Any:
    """The table as far as it was written, with all parts that follow this one.

    Raises
    ------
    TableError
        When there is none, or it has other columns, or is damaged.
    """
    return pa.Table.from_batches([batch for batch, _ in scan(path, schema)], schema=schema)


def scan(path: Path, schema: Any, only: str | None = None) -> Iterator[tuple[Any, Any]]:
    """The batches of a table as far as it was written, one at a time, each with its note if it has one; of all columns, or one.

    Raises
    ------
    TableError
        When there is none, or it has other columns, or is damaged.
    """
    wanted = schema if only is None else pa.schema([schema.field(only)])
    options = pa.ipc.IpcReadOptions(included_fields=None if only is None else [schema.get_field_index(only)])
    files = parts(path) or [path]
    for file in files:
        try:
            stream = pa.ipc.open_stream(pa.OSFile(str(file), "rb"), options=options)
            has = stream.schema.names
        except (OSError, pa.ArrowException, ValueError) as error:
            if file == files[-1] != path:  # who wrote it was killed where it began
                return
            raise TableError(f"{file}: no such table: {error}") from error
        if not stream.schema.equals(wanted):
            raise TableError(f"{file}: its columns are {has}, not {wanted.names}, or of other types")
        try:
            yield from _batches(stream)
        except (pa.ArrowException, MemoryError, ValueError) as error:
            raise TableError(f"{file}: it is damaged: {error}") from error


def _batches(stream: Any) -> Iterator[tuple[Any, Any]]:
    while True:
        try:
            batch, beside = stream.read_next_batch_with_custom_metadata()
        except (StopIteration, OSError, pa.ArrowInvalid):  # the end, or where a killed run stopped writing
            return
        batch.validate(full=True)  # what reads it later would believe every length and place in it
        note = None if beside is None else beside.get(_NOTE)
        yield batch, None if note is None else json.loads(note)
