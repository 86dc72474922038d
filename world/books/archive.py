"""The arrays of a run, written down while it flies: a file for each in a folder, whole at every moment."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import numpy as np

from analysis.models.arrays import Array
from netem.processes import system_errors
from world.books.growing import GrowingArray
from world.books.history import Moments, Reports, file_of, forms
from world.physics.world import World

UNBEGUN = ".unfinished"  # the folder ends so until all its files are there


class Archive:
    """Writes the moments of a run; `world.books.history.load` reads them, as far as they are there.

    Parameters
    ----------
    folder
        New; it is there from the first moments on.
    world, channels, reports
        What is flown, over how many channels, and what estimators report.

    Raises
    ------
    OSError
        By all its methods: when something cannot be written.
    """

    def __init__(self, folder: Path, world: World, channels: int, reports: Reports) -> None:
        self._folder = folder
        self._forms = forms(world, channels, reports)
        self._arrays: dict[str, GrowingArray] = {}
        self.ticks = 0

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for array in self._arrays.values():
            array.close()

    def extend(self, moments: Moments, next_position: Array) -> None:
        """Write down the next ticks, and where they led."""
        begins = not self._arrays
        if begins:
            self._begin()
        given = self._forms.keys() - moments.reports.keys()
        rows = {**moments.reports, **{name: getattr(moments, name) for name in given}}
        rows["position"] = np.concatenate([moments.position, next_position[None]])
        for name, array in self._arrays.items():
            array.write(self.ticks, rows[name])
        self.ticks += len(moments.error)
        for name, array in self._arrays.items():
            array.declare(self.ticks + (name == "position"))
        if begins:
            self._unbegun.rename(self._folder)

    @property
    def _unbegun(self) -> Path:
        return self._folder.with_name(self._folder.name + UNBEGUN)

    def _begin(self) -> None:
        with system_errors.about(self._unbegun):
            self._unbegun.mkdir()
        for name, form in self._forms.items():
            self._arrays[name] = GrowingArray(self._unbegun / file_of(name), form)
