"""affinet as a library: a run flown, or read from its directory, and what can be asked of it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from affinet.planning import making
from affinet.runtimes.run import Runtime, rehearse, runtime_of
from affinet.scenario import files, loading
from affinet.scenario.sections import Scenario, ScenarioError
from affinet.testing.swarm import Broken, FlownRun, flown
from affinet.verdicts import reading
from affinet.verdicts.evidence import Evidence
from netem.core.plain import shown
from netem.processes.user_code import UserCodeError
from world.books import realised as graphs
from world.books.realised import Realised

if TYPE_CHECKING:
    import pyarrow as pa


def run(
    scenario: str | Path | Scenario,
    *overrides: str,
    runtime: Runtime = "inprocess",
    out: str | Path | None = None,
) -> FlownRun:
    """Fly a scenario.

    Parameters
    ----------
    scenario
        The name of one that is shipped, the path of a file, or one that `affinet.scenario.load` read.
    overrides
        Changes to one that is named, as `key=value`; paths and modules in them are relative to the working directory.
    runtime
        "inprocess", or "processes": every agent one of its own. The answers are the same bits.
    out
        The run directory, new; without one the run leaves nothing behind.

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
    """
    flying = runtime_of(runtime)
    place = None if out is None else _path("out", out)
    given = _scenario(scenario, overrides)
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


def _scenario(given: str | Path | Scenario, overrides: Sequence[str]) -> Scenario:
    if not isinstance(given, Scenario):
        return loading.load(given, overrides, files.working_directory())
    if overrides:
        raise ScenarioError(f"{overrides[0]}: give overrides where the scenario is read: affinet.scenario.load")
    return loading.checked(given)


def _path(name: str, given: str | Path) -> Path:
    if not isinstance(given, str | PathLike):
        raise TypeError(f"{name} is {shown(given)}: give the path of a run directory")
    text = os.fspath(given)
    if not text or "\0" in text:
        raise ValueError(f"{name} is {text!r}, which is no path: give that of a run directory")
    return Path(text)
