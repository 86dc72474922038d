"""The arrays of a run as xarray and pandas have them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from affinet.scenario.words import among, shown
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.export import derived, extras, labelled, tables
from affinet.verdicts.export.tables import Column

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def of(run: Evidence) -> xr.Dataset:
    """An `xarray.Dataset` of a run.

    Raises
    ------
    NotInstalled
        When xarray is not there.
    """
    xarray = extras.needed("xarray", "xarray", "a dataset")
    variables = dict(labelled.variables(run, derived.whole(run))) | labelled.closing(run)
    return xarray.Dataset(
        {name: tuple(one) for name, one in variables.items()},
        {name: tuple(one) for name, one in labelled.coordinates(run).items()},
        labelled.about(run),
    )


def frame(run: Evidence, table: str) -> pd.DataFrame:
    """A `pandas.DataFrame` of a table of a run.

    Raises
    ------
    NotInstalled
        When pandas is not there.
    ValueError
        When there is no such table.
    """
    if table not in tables.NAMES:
        raise ValueError(f"table {shown(table)}: {among(table, tables.NAMES)}")
    pandas = extras.needed("pandas", "xarray", "a table")
    columns = tables.of_span(run, derived.whole(run), 0)[table]
    made = pandas.DataFrame({name: _values(pandas, column) for name, column in columns.items()})
    made.attrs = labelled.about(run) | {"units": {name: column.unit for name, column in columns.items() if column.unit}}
    return made


def _values(pandas: Any, column: Column) -> Any:
    if column.words:
        codes = np.where(column.is_there, column.values.astype(np.int64), -1)
        return pandas.Categorical.from_codes(codes, categories=list(column.words))
    return column.values if column.there is None else labelled.filled(column.values, column.there)
