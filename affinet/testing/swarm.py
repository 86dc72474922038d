"""A run as a test builds it: a scenario, faults chained onto it, and what came of it to assert on."""

from __future__ import annotations

import shutil
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, overload

from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.runtimes.rehearsing import rehearse, rehearse_all
from affinet.runtimes.run import Runtime, evidence, fly
from affinet.scenario import loading as scenarios
from affinet.scenario.overrides import Given
from affinet.scenario.sections import Scenario
from affinet.testing.many import FailedSeed, FlownSeeds, seeds_of
from affinet.verdicts.evidence import Evidence
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


class KeptWorst(NamedTuple):
    """The worst run of many seeds, the others that fail, a seed that passes, and the directory of the worst."""

    worst: FailedSeed
    others: Sequence[FailedSeed]
    passing: int | None
    out: Path


@dataclass(frozen=True)
class Swarm:
    """A run to be flown.

    Parameters
    ----------
    scenario
        With all faults so far.
    launch
        Flies a plan.
    launch_many
        Makes the runs of many seeds.
    """

    scenario: Scenario
    launch: Callable[[Plan], FlownRun]
    launch_many: Callable[[Scenario, Sequence[int]], FlownSeeds]

    def fault(self, verb: str, **keys: Any) -> Swarm:
        """The same run with one more entry in its timeline: the keys are those of a scenario file (docs/scenario.md).

        Raises
        ------
        ScenarioError
            When a file that said so would be refused.
        """
        return replace(self, scenario=scenarios.extended(self.scenario, [{"verb": verb} | keys]))

    @overload
    def fly(self, verdict: RunVerdict = "pass", *, seeds: None = None) -> FlownRun: ...

    @overload
    def fly(self, *, seeds: int | Sequence[int]) -> FlownSeeds: ...

    def fly(self, verdict: RunVerdict = "pass", *, seeds: int | Sequence[int] | None = None) -> FlownRun | FlownSeeds:
        """Fly it, once or with many seeds.

        Parameters
        ----------
        verdict
            What the run itself must come to. A fault that touched nothing makes it "vacuous"; divergence makes it "fail".
        seeds
            How many runs, with successive seeds from that of the scenario on; or which seeds. They fly when they are checked.

        Raises
        ------
        Broken
            When it comes to another, or an estimator or law does something wrong: why.
        ScenarioError, PlanError
            When it cannot fly.
        ValueError, TypeError
            When these are no seeds, or a verdict is given with them.
        """
        __tracebackhide__ = True
        if seeds is not None:
            if verdict != "pass":
                raise ValueError(
                    f"verdict {verdict!r} is of one run: with seeds, say in `check` which share has to pass"
                )
            return self.launch_many(self.scenario, seeds_of(self.scenario.seed, seeds))
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
        self._many: list[FlownSeeds] = []
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
            scenarios.load(name, (*seed, *overrides, *([settings] if settings else [])), self._folder),
            self._launch,
            self._launch_many,
        )

    @property
    def unasked(self) -> bool:
        """Whether runs of many seeds were asked nothing, and so have not flown."""
        return any(not many.asked for many in self._many)

    def keep(self) -> list[tuple[Plan, Path]]:
        """The last runs, each with a directory that holds all of it; those flown in process are flown again to record them."""
        return [(plan, out or self._recorded(plan)) for plan, out in self._flown]

    def keep_worst(self) -> list[KeptWorst]:
        """Of many seeds of which too many fail, the worst run, flown once more over processes."""
        kept = []
        for many in self._many:
            for asked in many.asked:
                if asked.verdict != "holds" and (worst := asked.worst) is not None:
                    out = self._room() / "run"
                    fly(many.plan(worst.seed), "processes", out, lambda *_: None)
                    others = [one for one in asked.failed if one is not worst]
                    kept.append(KeptWorst(worst, others, next(iter(asked.passed), None), out))
        return kept

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

    def _launch_many(self, scenario: Scenario, seeds: Sequence[int]) -> FlownSeeds:
        self._many.append(FlownSeeds(scenario, seeds, self._fly_many))
        return self._many[-1]

    def _fly_many(self, plans: Sequence[Plan]) -> Sequence[Evidence]:
        if self.runtime == "inprocess":
            return rehearse_all(plans)
        return [self._over_processes(plan) for plan in plans]

    def _over_processes(self, plan: Plan) -> FlownRun:
        room = self._room()
        try:
            return flown(plan, "processes", room / "run")
        finally:
            shutil.rmtree(room)

    def _recorded(self, plan: Plan) -> Path:
        out = self._room() / "run"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the numbers of a run that diverged do not fit a recording
            fly(plan, "inprocess", out, lambda *_: None)
        return out
