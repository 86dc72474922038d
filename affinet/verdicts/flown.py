"""A run as Python has it: what can be asked of it, in which forms it is had, and how it is looked at."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from affinet.scenario.words import among
from affinet.verdicts import beside, metrics, told
from affinet.verdicts.checking import CheckResult, as_checker
from affinet.verdicts.evidence import Evidence
from analysis.models.arrays import Array

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


class Broken(AssertionError):
    """A run, or what was checked of it, did not come out as the test expects."""


class FlownRun(Evidence):
    """A run that was flown: its arrays, and its faults with what they touched."""

    @classmethod
    def of(cls, evidence: Evidence) -> FlownRun:
        """The run that left this evidence."""
        return cls(evidence.plan, evidence.arrays, evidence.outcome)

    def check(self, *checkers: Callable[[Evidence], CheckResult]) -> FlownRun:
        """The run itself if every checker passes; one that is vacuous proves nothing, and fails.

        Parameters
        ----------
        checkers
            Each a `Checker`, or a function that is to be one under its own name.

        Raises
        ------
        Broken
            When one does not pass: which, why, and the first tick that offends.
        UserCodeError
            When one fails itself, or returns no `CheckResult`.
        TypeError
            When one is none.
        """
        __tracebackhide__ = True
        findings = [checker(self) for checker in map(as_checker, checkers)]
        if wrong := [finding for finding in findings if finding.verdict != "pass"]:
            raise Broken("\n".join(map(str, wrong)))
        return self

    def metric(self, name: str) -> Array:
        """A metric of the checker `below`, like "nees", in each tick, shape (T,), in its unit.

        NaN where there is nothing to take it of, infinite where it is no number.

        Raises
        ------
        ValueError
            When there is no such metric.
        """
        if name not in metrics.METRICS:
            raise ValueError(f"no metric {name!r}; {among(name, metrics.METRICS)}")
        return metrics.of_run(self, name, range(self.ticks))

    def parting(self, other: Evidence) -> str:
        """Where another run parts from this one, bit by bit and in words: the tick, the array, and of whom.

        Of what both have; runs of estimators that say other things share some channels and arrays.
        """
        return beside.parting(self, other)

    @property
    def dataset(self) -> xr.Dataset:
        """All arrays with names on their axes, units and labels, NaN where there is nothing: an `xarray.Dataset`.

        Raises
        ------
        NotInstalled
            When xarray is not there: `pip install 'affinet[xarray]'`.
        """
        from affinet.verdicts.export import dataset

        return dataset.of(self)

    def to_pandas(self, table: str = "agents") -> pd.DataFrame:
        """A table of columns, a row for each tick ("ticks"), tick and agent ("agents"), or tick, agent and neighbour ("links").

        Raises
        ------
        NotInstalled
            When pandas is not there: `pip install 'affinet[xarray]'`.
        ValueError
            When there is no such table.
        """
        from affinet.verdicts.export import dataset

        return dataset.frame(self, table)

    def to_netcdf(self, file: str | Path) -> None:
        """Write what `dataset` holds into a new file, which xarray opens.

        Raises
        ------
        FileExistsError
            When there is such a file.
        OSError
            When it cannot be written.
        """
        self._write("netcdf", file)

    def to_parquet(self, folder: str | Path) -> None:
        """Write the tables of `to_pandas` into a new folder, each a file.

        Raises
        ------
        FileExistsError
            When there is such a folder.
        OSError
            When it cannot be written.
        """
        self._write("parquet", folder)

    def show(self) -> None:
        """Look at it in a notebook: in Rerun's viewer, where that is there and the run left a recording, or as a picture.

        Raises
        ------
        RuntimeError
            Outside of a notebook.
        """
        from affinet.verdicts import looking

        looking.show(self)

    def __repr__(self) -> str:
        rows = [f"  {name}: {says}" for name, says in told.rows(self)]
        return "\n".join([f"<{type(self).__name__}: {told.title(self)}", *rows]) + ">"

    def _repr_html_(self) -> str:
        from affinet.verdicts import notebook

        return notebook.html(self)

    def _write(self, form: str, out: str | Path) -> None:
        from affinet.verdicts.export import formats

        formats.write(self, form, Path(out))
