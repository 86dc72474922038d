"""Parquet: a table in each file, with units and descriptions of its columns, which pandas, Polars and DuckDB read."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from affinet.verdicts.evidence import Evidence
from affinet.verdicts.export import derived, folder, labelled, tables
from affinet.verdicts.export.tables import Column, Table


def write(run: Evidence, out: Path) -> None:
    """Write the tables of a run into a folder, new, some ticks at a time.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    from pyarrow.parquet import ParquetWriter  # takes a while to import

    with folder.new(out), ExitStack() as files:
        writers: dict[str, Any] = {}
        first = 0
        for span in derived.by_parts(run):
            for name, table in tables.of_span(run, span, first).items():
                rows = _arrow(table, labelled.about(run))
                if name not in writers:
                    writers[name] = files.enter_context(ParquetWriter(out / f"{name}.parquet", rows.schema))
                writers[name].write_table(rows)
            first += len(span["error"])


def _arrow(table: Table, about: dict[str, str]) -> Any:
    import pyarrow as pa

    arrays = {name: _array(column) for name, column in table.items()}
    fields = [
        pa.field(name, array.type, metadata={"units": table[name].unit, "long_name": table[name].says})
        for name, array in arrays.items()
    ]
    return pa.table(list(arrays.values()), schema=pa.schema(fields, metadata=about))


def _array(column: Column) -> Any:
    import pyarrow as pa

    absent = ~column.is_there
    if not column.words:
        return pa.array(column.values, mask=absent)
    codes = pa.array(column.values.astype(np.int8), mask=absent)
    return pa.DictionaryArray.from_arrays(codes, pa.array(column.words))
