"""A recorded flight, of a CSV file or of a run directory -> the flight that stands in for the world, tick by tick."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from affinet.planning import csv_logs
from affinet.planning.blueprint import formation_of
from affinet.scenario import bodies, inputs, loading
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from netem.core.links import Links
from world.books import history
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
        return _of_run(path, given, world) if path.is_dir() else csv_logs.read(path, world)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{_KEY}: {error}") from error


def _of_run(out: Path, given: Scenario, world: World) -> RecordedFlight:
    before, links = loading.resolved(out), world.links
    if abs(before.time.dt - given.time.dt) > _TOLERANCE * given.time.dt:
        raise ValueError(
            f"{out}: it was flown at dt {before.time.dt:g} s, and this is {given.time.dt:g} s: set time.dt alike"
        )
    flown = formation_of(before)
    if Links.both_ways(flown.agents, flown.edges).index != links.index:
        raise ValueError(f"{out}: it was flown over other links: leave the formation as it was")
    sensed = bodies.sensor(before.sensing, world.formation.dimension).reads
    if sensed != world.sensor.reads:
        raise ValueError(f"{out}: its sensors said {sensed}, and these say {world.sensor.reads}: set sensing alike")
    if before.dynamics.order != 1:
        raise ValueError(f"{out}: its bodies were steered by more than velocities, of which a run keeps no record")
    rows = {"measured": len(links), "position": links.agents, "input": links.agents}
    measured, position, flown_by = (
        _array(out / file, (rows[Path(file).stem], world.formation.dimension)) for file in inputs.FLIGHT
    )
    ticks, has = given.time.ticks, min(len(measured), len(flown_by), len(position) - 1)
    if has < ticks:
        raise ValueError(f"{out}: it ends after {has * before.time.dt:g} s: set time.duration to that, or less")
    return RecordedFlight(measured[:ticks], position[: ticks + 1], flown_by[:ticks])


def _array(file: Path, row: tuple[int, int]) -> NDArray[np.float64]:
    if not file.exists():
        raise ValueError(f"{file.parent.parent}: no run wrote {file.name} there: name the directory of a run")
    array = history.read(file)
    if array.dtype != np.float64 or array.shape[1:] != row:
        raise history.Damaged(file, f"{array.dtype} of shape {array.shape[1:]} in a tick, where {row} are due")
    if (np.abs(array) > csv_logs.LARGEST).any() or (file.stem == "input" and np.isnan(array).any()):
        raise history.Damaged(file, f"it has numbers that no robot can have, as above {csv_logs.LARGEST:g}")
    return np.array(array)
