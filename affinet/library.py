"""affinet as a library: a run flown, or read from its directory, and what can be asked of it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from affinet.planning import making
from affinet.runtimes.run import Runtime, rehearse
from affinet.scenario import loading
from affinet.scenario.sections import Scenario, ScenarioError
from affinet.testing.swarm import Broken, FlownRun, flown
from affinet.verdicts import reading
from affinet.verdicts.evidence import Evidence
from netem.medium.medium import JOURNAL
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
    """
    if isinstance(scenario, Scenario) and overrides:
        raise ScenarioError(f"{overrides[0]}: give overrides where the scenario is read: affinet.scenario.load")
    given = scenario if isinstance(scenario, Scenario) else loading.load(str(scenario), overrides, Path.cwd())
    try:
        plan = making.make(given)
        if out is not None:
            return flown(plan, runtime, Path(out))
        if runtime == "inprocess":
            return FlownRun.of(rehearse(plan))
    except UserCodeError as error:
        raise Broken(str(error)) from error
    with tempfile.TemporaryDirectory(prefix="affinet-") as folder:
        return flown(plan, runtime, Path(folder) / "run")


def load(directory: str | Path) -> FlownRun:
    """The run that left a directory, with its arrays and the verdict it came to.

    Raises
    ------
    ScenarioError
        When the directory holds no run, or one that has left no summary or no arrays.
    """
    return FlownRun.of(reading.evidence(Path(directory)))


def journal(directory: str | Path) -> pa.Table:
    """The journal of a run directory: a row for every verdict, with the columns of docs/network.md.

    Raises
    ------
    ValueError
        When there is none, or it is damaged.
    """
    from netem.medium import journal as journals  # pyarrow takes a while to import

    return journals.read(Path(directory) / JOURNAL)


def realised(evidence: Evidence) -> Realised:
    """The graph that messages made of a run, tick by tick and channel by channel; sensing is the first channel."""
    world, plan = evidence.plan.world, evidence.plan
    return graphs.realise(evidence.arrays["newest"], world.formation, evidence.timeline, world.dt, plan.window)
