"""Every fault of a class flown: a certificate that invariants hold under each, or what broke them."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from hashlib import blake2b
from importlib.metadata import version
from typing import Any

from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.testing.every import Every
from affinet.testing.flights import Each, Flown, fly, in_order
from affinet.testing.hunt import Quarry, refuse_failing_undisturbed
from affinet.testing.trial import Trial
from affinet.verdicts.checking import CheckResult
from netem.processes.user_code import UserCodeError

AT_ONCE = 128  # trials that fly side by side


@dataclass
class Flights:
    """What came of all faults of a class.

    Parameters
    ----------
    flown, untold
        How many flew, and in how many of them a fault touched nothing, or an invariant was not put to the test.
    broken
        By the number of the invariant, what broke it and how; the shortest first.
    digest
        Of all runs.
    """

    flown: int = 0
    untold: int = 0
    broken: dict[int, list[tuple[Trial, CheckResult, str]]] = field(default_factory=dict)
    digest: str = ""

    @property
    def certain(self) -> bool:
        """Whether all hold, and some were put to the test."""
        return not self.broken and self.untold < self.flown


def fly_every(quarry: Quarry, trials: Sequence[Trial], each: Each, watch: Callable[[Flights], None]) -> Flights:
    """Fly all faults of a class.

    Parameters
    ----------
    quarry, trials
        What must hold, and all faults in all scenarios.
    each
        Flies chunks of trials, in this process or in others.
    watch
        Told how far it is.

    Raises
    ------
    ScenarioError
        When an invariant fails with no fault added, or a fault is none of the scenario.
    UserCodeError
        When a user's own estimator or law does something wrong.
    """
    refuse_failing_undisturbed(quarry, each)
    found, digest = Flights(), blake2b(digest_size=16)
    chunks = [trials[first : first + AT_ONCE] for first in range(0, len(trials), AT_ONCE)]
    cases = [[quarry.case(trial) for trial in chunk] for chunk in chunks]
    with closing(each(partial(fly, quarry.make), cases)) as flown:
        for chunk, made in zip(chunks, in_order(flown), strict=True):
            for trial, one in zip(chunk, made, strict=True):
                whole = one if one is not None and not one.raised else _refused(quarry, trial)
                digest.update(whole.digest.encode())
                _count(found, trial, whole)
            watch(found)
    found.digest = digest.hexdigest()
    return found


def certificate(every: Every, quarry: Quarry, found: Flights) -> dict[str, Any]:
    """What is certain, and what it does not say, in plain values and in words.

    Parameters
    ----------
    every, quarry
        The class, what holds, and in which scenarios.
    found
        What came of all of them; none broke anything.
    """
    given = next(iter(quarry.scenarios.values()))
    names = [one.name for one in quarry.make()]
    seeds = ", ".join(map(str, quarry.seeds))
    held = found.flown - found.untold
    runs = f"runs of {given.time.ticks * given.time.dt:g} s, in ticks of {given.time.dt:g} s"
    told = f", of which {found.untold} put nothing to the test" if found.untold else ""
    return {
        "certificate": f"nothing of the class '{every}' breaks {' or '.join(names)}: all {found.flown} flown{told}, {runs}",
        "class": str(every),
        "invariants": names,
        "flown": found.flown,
        "held": held,
        "put_nothing_to_the_test": found.untold,
        "seeds": list(quarry.seeds),
        "settings": [list(settings) for settings in quarry.scenarios],
        "estimator": given.agents.estimator,
        "law": given.agents.law,
        "does_not_cover": [
            f"beginnings and lengths between the steps of {every.raster:g} s",
            f"lengths above {every.most:g} s, and faults that last beyond the end of the run",
            f"more than {_many(every)} at once, one fault after another, and any verb but {every.verb}",
            f"other seeds than {seeds}: other noise and losses",
            "other settings of the scenario than those here",
            *([f"{found.untold} runs that put nothing to the test"] if found.untold else []),
        ],
        "version": version("affinet"),
        "digest": found.digest,
        "scenarios": [loading.to_toml(one) for one in quarry.scenarios.values()],
    }


def _many(every: Every) -> str:
    return f"{every.number} {every.what}{'s' if every.number > 1 else ''}"


def _refused(quarry: Quarry, trial: Trial) -> Flown:
    """Of what is no fault of its scenario, or meets a user's own code that does something wrong: it says so itself."""
    try:
        rehearse(planning.make(trial.in_scenario(quarry.case(trial).given)))
    except UserCodeError as error:
        error.during = f"with the timeline {json.dumps(trial.entries)}"
        raise
    raise AssertionError(f"{trial.key} flies alone and not with others")


def _count(found: Flights, trial: Trial, one: Flown) -> None:
    found.flown += 1
    found.untold += one.untold
    for number, finding in enumerate(one.findings):
        if one.breaks(number):
            found.broken.setdefault(number, []).append((trial, finding, one.digest))
