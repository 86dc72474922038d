"""The formats in which a run can be had, by their names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from affinet.verdicts.evidence import Evidence
from netem.processes.system_errors import about


class Format(NamedTuple):
    """How the names of its files or folders end, and what it is, for people."""

    ending: str
    says: str


FORMATS: Mapping[str, Format] = {
    "parquet": Format("-parquet", "a folder of tables that pandas, Polars and DuckDB read"),
    "netcdf": Format(".nc", "a file of labelled arrays that xarray, MATLAB and R open"),
    "mcap": Format(".mcap", "a file that Foxglove and PlotJuggler open"),
    "csv": Format("-csv", "a folder of tables as text"),
}


def write(run: Evidence, form: str, out: Path) -> None:
    """Write a run in a format of `FORMATS` to a path where nothing is.

    Raises
    ------
    NotInstalled
        When the library for it is missing.
    FileExistsError
        When something is there already.
    OSError
        When it cannot be written.
    """
    from affinet.verdicts.export import csv, mcap, netcdf, parquet  # the command line knows their names alone

    if out.exists():
        raise FileExistsError(f"{str(out)!r} is there already; name another place")
    writers = {"parquet": parquet.write, "netcdf": netcdf.write, "mcap": mcap.write, "csv": csv.write}
    with about(out):
        writers[form](run, out)
