"""netCDF-4: labelled arrays in one file, which xarray, MATLAB, R and Julia open."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from affinet.verdicts.evidence import Evidence
from affinet.verdicts.export import derived, labelled
from affinet.verdicts.export.labelled import Variable
from netem.processes.whole import whole

_COMPRESSED = {"compression": "gzip", "compression_opts": 4, "shuffle": True}


def write(run: Evidence, out: Path) -> None:
    """Write a run into a file, whole or not at all, some ticks at a time.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    import h5netcdf  # takes a while to import

    with whole(out) as unfinished, h5netcdf.File(unfinished, "w") as file:
        coordinates = labelled.coordinates(run)
        beside = " ".join(name for name, one in coordinates.items() if name not in one.axes)
        file.attrs.update(labelled.about(run) | {"coordinates": beside})
        file.dimensions = labelled.lengths(run)
        for name, one in (coordinates | labelled.closing(run)).items():
            create(file, name, one)[...] = one.values
        begun = 0
        for span in derived.by_parts(run):
            for name, one in labelled.variables(run, span):
                held = file.variables[name] if begun else create(file, name, one)
                held[begun : begun + len(one.values)] = _storable(one.values)
            begun += len(span["error"])


def create(file: Any, name: str, one: Variable) -> Any:
    """A variable of an open file, with axes, kind of numbers and attributes of this one, and no values yet."""
    import h5py  # takes a while to import

    numbers = one.values.dtype == np.float64 and one.values.ndim > 0 and name not in one.axes
    how = {**_COMPRESSED, "fillvalue": np.nan} if numbers else {}
    truths = {"dtype": "bool"} if one.values.dtype == bool else {}  # as xarray says it: netCDF has none
    kind = h5py.string_dtype() if one.values.dtype == object else _storable(one.values).dtype
    made = file.create_variable(name, tuple(one.axes), dtype=kind, **how)
    made.attrs.update({**one.attributes, **truths})
    return made


def _storable(values: Any) -> Any:
    return values.astype(np.int8) if values.dtype == bool else values
