"""A recorded flight, of a CSV file or of a run directory -> the flight that stands in for the world, tick by tick."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from affinet.planning import csv_logs
from affinet.planning.blueprint import formation_of
from affinet.scenario import inputs, loading
from affinet.scenario.sections import Scenario, ScenarioError
from netem.core.links import Links
from world.books import growing
from world.physics.recorded import RecordedFlight
from world.physics.world import World

_KEY = "recorded.flight"
_TOLERANCE = 1e-9  # of a tick's length


def of(given: Scenario, world: World) -> RecordedFlight | None:
    """The flight that a scenario names, for a world of its formation, if it names one.

    Raises
    ------
    ScenarioError
        When there is no such flight, or it is of other links, of another clock, or too short.
    """
    if given.recorded is None:
        return None
    path = Path(given.recorded.flight)
    try:
        return _of_run(path, given, world.links) if path.is_dir() else csv_logs.read(path, world)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{_KEY}: {error}") from error


def _of_run(out: Path, given: Scenario, links: Links) -> RecordedFlight:
    before = loading.resolved(out)
    if abs(before.time.dt - given.time.dt) > _TOLERANCE * given.time.dt:
        raise ValueError(
            f"{out}: it was flown at dt {before.time.dt:g} s, and this is {given.time.dt:g} s: set time.dt alike"
        )
    flown = formation_of(before)
    if Links.both_ways(flown.agents, flown.edges).index != links.index:
        raise ValueError(f"{out}: it was flown over other links: leave the formation as it was")
    if before.dynamics.order != 1:
        raise ValueError(f"{out}: its bodies were steered by more than velocities, of which a run keeps no record")
    measured, position, flown_by = (_array(out / file) for file in inputs.FLIGHT)
    ticks, has = given.time.ticks, min(len(measured), len(flown_by), len(position) - 1)
    if has < ticks:
        raise ValueError(f"{out}: it ends after {has * before.time.dt:g} s: set time.duration to that, or less")
    return RecordedFlight(measured[:ticks], position[: ticks + 1], flown_by[:ticks])


def _array(file: Path) -> NDArray[np.float64]:
    try:
        array = growing.read(file)
    except FileNotFoundError as error:
        raise ValueError(
            f"{file.parent.parent}: no run wrote {file.name} there: name the directory of a run"
        ) from error
    if array.dtype != np.float64 or array.ndim != 3:
        raise ValueError(f"{file}: not what a run wrote there: {array.dtype} of shape {array.shape}")
    return np.array(array)
