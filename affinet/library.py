"""affinet as a library: a run flown, or read from its directory, and what can be asked of it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from affinet.planning import making
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import Runtime, runtime_of
from affinet.scenario import files, loading
from affinet.scenario.overrides import Given
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from affinet.testing.swarm import flown
from affinet.verdicts import reading
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.flown import Broken, FlownRun
from agents.estimators.base import Estimator
from agents.laws.base import Law
from netem.core.plain import shown
from netem.processes.user_code import UserCodeError
from world.books import realised as graphs
from world.books.realised import Realised

if TYPE_CHECKING:
    import pyarrow as pa


def run(
    scenario: str | Path | Scenario,
    *overrides: Given,
    estimator: str | Estimator[Any] | None = None,
    law: str | Law[Any] | None = None,
    availability: float | None = None,
    seed: int | None = None,
    duration: float | None = None,
    dt: float | None = None,
    runtime: Runtime = "inprocess",
    out: str | Path | None = None,
    **tables: Any,
) -> FlownRun:
    """Fly a scenario.

    Whatever is not given stays as the scenario says it. Of two that give the same key the later holds, and keywords come last.

    Parameters
    ----------
    scenario
        The name of one that is shipped, the path of a file, or one that `affinet.scenario.load` read, with its overrides.
    overrides
        Of any key: tables like `{"network.delay_ticks": 1}`, or texts like "network.delay_ticks=1", as behind --set. Paths and
        modules in them are relative to the working directory.
    estimator, law
        Which the agents run: a name, "module:Class", or an object, `MyFilter(gain=2.0)`. Over processes its class has to be in
        a module, not in the script or notebook that runs.
    availability
        The probability that a message gets through.
    seed
        Of all random draws.
    duration, dt
        Of the run and of a tick, in seconds.
    runtime
        "inprocess", or "processes": every agent one of its own. The answers are the same bits.
    out
        The run directory, new; without one the run leaves nothing behind.
    tables
        Tables of the scenario by their names (docs/scenario.md), of each what is to change: `time={"exchange": "next-tick"}`.

    Raises
    ------
    ScenarioError
        When there is no such scenario, or something in it is wrong.
    PlanError
        When it cannot fly.
    Broken
        When an estimator or a law does something wrong, or the run leaves no arrays. What else a run comes to, fail or
        vacuous, is in its outcome.
    FileExistsError
        When `out` holds a run already.
    OSError
        When `out` cannot be made or written to.
    ValueError
        When there is no such runtime, or `out` is no path.
    TypeError
        When one of these is something else than is asked for.

    Examples
    --------
    >>> run = affinet.run("corridor", estimator="rkf", availability=0.5, network={"delay_ticks": 1})
    """
    flying = runtime_of(runtime)
    place = None if out is None else _path("out", out)
    short = {
        "estimator": estimator,
        "law": law,
        "availability": availability,
        "seed": seed,
        "duration": duration,
        "dt": dt,
    }
    given = _scenario(scenario, overrides, {name: value for name, value in short.items() if value is not None} | tables)
    try:
        plan = making.make(given)
        if place is not None:
            return flown(plan, flying, place)
        if flying == "inprocess":
            return FlownRun.of(rehearse(plan))
    except UserCodeError as error:
        raise Broken(str(error)) from error
    with tempfile.TemporaryDirectory(prefix="affinet-") as folder:
        return flown(plan, flying, Path(folder) / "run")


def load(directory: str | Path) -> FlownRun:
    """The run that left a directory, with its arrays and the verdict it came to.

    Raises
    ------
    ScenarioError
        When the directory holds no run, or one that has left no summary or no arrays, or its scenario cannot be read any more.
    PlanError, UserCodeError
        When its scenario cannot fly any more, or a module of its own fails.
    Damaged
        When its summary, arrays or journal are not what the run wrote, as those of an older affinet may be: which file, and
        what is wrong in it.
    ValueError, TypeError
        When `directory` is no path.
    """
    return FlownRun.of(reading.evidence(_path("directory", directory)))


def journal(directory: str | Path) -> pa.Table:
    """The journal of a run directory: a row for every verdict, with the columns of docs/network.md.

    Raises
    ------
    Damaged
        When there is none, or it is not what a run wrote.
    ValueError, TypeError
        When `directory` is no path.
    """
    return reading.journal(_path("directory", directory))


def realised(evidence: Evidence) -> Realised:
    """The graph that messages made of a run, tick by tick and channel by channel; sensing is the first channel.

    Raises
    ------
    TypeError
        When it is no run.
    """
    if not isinstance(evidence, Evidence):
        raise TypeError(f"{shown(evidence)} is no run: give what affinet.run or affinet.load returned")
    world, plan = evidence.plan.world, evidence.plan
    return graphs.realise(evidence.arrays["newest"], world.formation, evidence.timeline, world.dt, plan.window)


def _scenario(given: str | Path | Scenario, overrides: Sequence[Given], settings: Mapping[str, Any]) -> Scenario:
    if not isinstance(given, Scenario):
        return loading.load(given, (*overrides, *([settings] if settings else [])), files.working_directory())
    for one in (*overrides, *settings):
        raise ScenarioError(f"{one}: give overrides where the scenario is read: affinet.scenario.load")
    return loading.checked(given)


def _path(name: str, given: str | Path) -> Path:
    if not isinstance(given, str | PathLike):
        raise TypeError(f"{name} is {shown(given)}: give the path of a run directory")
    text = os.fspath(given)
    if not text or "\0" in text:
        raise ValueError(f"{name} is {text!r}, which is no path: give that of a run directory")
    return Path(text)
