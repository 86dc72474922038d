"""A run as a test builds it: a scenario, faults chained onto it, and what came of it to assert on."""

from __future__ import annotations

import shutil
import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import Runtime, evidence, fly
from affinet.scenario import loading as scenarios
from affinet.scenario.overrides import Given
from affinet.scenario.sections import Scenario
from affinet.verdicts.flown import Broken, FlownRun
from affinet.verdicts.outcome import RunVerdict
from netem.processes.user_code import UserCodeError

_KEPT = 4


def flown(plan: Plan, runtime: Runtime, out: Path) -> FlownRun:
    """Fly a plan into a run directory.

    Raises
    ------
    Broken
        When an estimator or a law does something wrong, or the run leaves no arrays: why.
    """
    done = fly(plan, runtime, out, lambda *_: None)
    landed = evidence(plan, done)
    if done.user_code:
        raise Broken("; ".join(done.reasons))
    if landed is None:
        raise Broken(f"the run left nothing: {'; '.join(done.reasons)}")
    return FlownRun.of(landed)


@dataclass(frozen=True)
class Swarm:
    """A run to be flown.

    Parameters
    ----------
    scenario
        With all faults so far.
    launch
        Flies a plan.
    """

    scenario: Scenario
    launch: Callable[[Plan], FlownRun]

    def fault(self, verb: str, **keys: Any) -> Swarm:
        """The same run with one more entry in its timeline: the keys are those of a scenario file (docs/scenario.md).

        Raises
        ------
        ScenarioError
            When a file that said so would be refused.
        """
        return replace(self, scenario=scenarios.extended(self.scenario, [{"verb": verb} | keys]))

    def fly(self, verdict: RunVerdict = "pass") -> FlownRun:
        """Fly it.

        Parameters
        ----------
        verdict
            What the run itself must come to. A fault that touched nothing makes it "vacuous"; divergence makes it "fail".

        Raises
        ------
        Broken
            When it comes to another, or an estimator or law does something wrong: why.
        ScenarioError, PlanError
            When it cannot fly.
        """
        __tracebackhide__ = True
        try:
            flown = self.launch(planning.make(self.scenario))
        except UserCodeError as error:
            raise Broken(str(error)) from error
        if flown.outcome.verdict != verdict:
            why = "; ".join(flown.outcome.reasons) or "every fault bit and nothing broke"
            raise Broken(f"the run is {flown.outcome.verdict}, not {verdict}: {why}")
        return flown


class SwarmRuns:
    """The runs of one test: it flies them, and keeps what a failure needs.

    Parameters
    ----------
    runtime
        In which they are flown.
    seed
        For all of them; None leaves each scenario's own.
    room
        Makes a new, empty directory.
    folder
        Of the test: paths in it, and modules it names, are relative to that.
    """

    def __init__(self, runtime: Runtime, seed: int | None, room: Callable[[], Path], folder: Path) -> None:
        self.runtime = runtime
        self._seed = seed
        self._room = room
        self._folder = folder
        self._flown: deque[tuple[Plan, Path | None]] = deque(maxlen=_KEPT)
        self._rooms: list[Path] = []
        self.failed = False

    def __call__(self, scenario: str | Path, *overrides: Given, **settings: Any) -> Swarm:
        """A run of a scenario, shipped or a file, changed as by `affinet.run`; paths are relative to the test's folder.

        Raises
        ------
        ScenarioError
            When there is none, or something in it is wrong.
        """
        seed = () if self._seed is None else (f"seed={self._seed}",)
        name = str(self._folder / scenario) if str(scenario).endswith(".toml") else str(scenario)
        return Swarm(
            scenarios.load(name, (*seed, *overrides, *([settings] if settings else [])), self._folder), self._launch
        )

    def keep(self) -> list[tuple[Plan, Path]]:
        """The last runs, each with a directory that holds all of it; those flown in process are flown again to record them."""
        return [(plan, out or self._recorded(plan)) for plan, out in self._flown]

    def clear(self) -> None:
        """Leave nothing behind of runs that nobody needs to look at."""
        for room in self._rooms:
            shutil.rmtree(room)

    def _launch(self, plan: Plan) -> FlownRun:
        if self.runtime == "inprocess":
            self._flown.append((plan, None))
            return FlownRun.of(rehearse(plan))
        self._rooms.append(self._room())
        out = self._rooms[-1] / "run"
        self._flown.append((plan, out))
        return flown(plan, "processes", out)

    def _recorded(self, plan: Plan) -> Path:
        out = self._room() / "run"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the numbers of a run that diverged do not fit a recording
            fly(plan, "inprocess", out, lambda *_: None)
        return out
