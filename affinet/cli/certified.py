"""`affinet hunt --every`: all faults of a class, and the certificate or the counterexamples that they leave."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from pathlib import Path

from rich import progress as bar
from rich.console import Console

from affinet.cli.notes import note
from affinet.cli.progress import Bar
from affinet.cli.quarry import confirm, flown_by, places_of, quarry_of, write
from affinet.cli.show import plain
from affinet.cli.status import FAIL, PASS
from affinet.runtimes import directories
from affinet.scenario.wrong import ScenarioError
from affinet.testing import every
from affinet.testing.certificate import Flights, certificate, fly_every
from affinet.testing.hunt import Counterexample, Quarry
from netem.processes.system_errors import about

_OTHER = ("verbs", "budget", "corpus", "frontier")
_TOLD = 6  # of what broke an invariant


def fly_and_certify(parsed: argparse.Namespace) -> int:
    """Fly all faults of a class, and leave a certificate, or the shortest fault that breaks each invariant.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, OSError
        When it cannot begin, or what it leaves not be written.
    """
    if others := [name for name in _OTHER if getattr(parsed, name)]:
        raise ScenarioError(
            f"--every and --{others[0]}: nothing is drawn of a class that is flown whole; leave one out"
        )
    those, quarry = every.parse(parsed.every), quarry_of(parsed)
    trials = [*those.trials(quarry.scenarios, quarry.seeds)]
    note(f"{those}: {len(trials)} runs of {max(one.time.ticks for one in quarry.scenarios.values())} ticks")
    places = places_of(parsed, quarry)
    file = directories.for_certificate(parsed.certificate or Path(parsed.scenario).stem)
    with ExitStack() as claimed:
        for place in (*places, file):
            claimed.enter_context(directories.unless_empty(place))
        with Bar("every", len(trials), bar.BarColumn(), bar.TextColumn("{task.fields[says]}")) as shown:
            found = fly_every(quarry, trials, flown_by(parsed.jobs), lambda now: shown.see(now.flown, _says(now)))
        smallest = [_smallest(quarry, number, found) for number in sorted(found.broken)]
        for one in smallest:
            write(one.scenario, places[one.number])
        says = certificate(those, quarry, found)
        if found.certain:
            with about(file):
                file.write_text(json.dumps(says, indent=1) + "\n", encoding="utf-8")
    _show(found, quarry, says if found.certain else None, file)
    for one in smallest:
        confirm(one, quarry, places[one.number])
    if parsed.json:
        print(json.dumps(_plain(found, quarry, file)))  # noqa: T201
    return PASS if found.certain else FAIL


def _says(found: Flights) -> str:
    return f"{found.flown} flown, {sum(map(len, found.broken.values()))} broke"


def _smallest(quarry: Quarry, number: int, found: Flights) -> Counterexample:
    trial, finding, digest = found.broken[number][0]
    return Counterexample(number, trial.in_scenario(quarry.case(trial).given), finding, digest, trial)


def _show(found: Flights, quarry: Quarry, says: dict[str, object] | None, file: Path) -> None:
    console = Console()
    if says is not None:
        console.print(plain(str(says["certificate"])), soft_wrap=True)
        for line in says["does_not_cover"] if isinstance(says["does_not_cover"], list) else ():
            console.print(plain(f"  not covered: {line}"), soft_wrap=True)
        console.print(plain(f"{file}"), soft_wrap=True)
        return
    if not found.broken:
        console.print(
            plain(f"no certificate: none of {found.flown} runs put the invariants to the test"), soft_wrap=True
        )
    names = [one.name for one in quarry.make()]
    for number, those in sorted(found.broken.items()):
        console.print(plain(f"no certificate: {len(those)} of {found.flown} break {names[number]}"), soft_wrap=True)
        for trial, finding, _ in those[:_TOLD]:
            entry = dict(trial.faults[0][0])
            where = "".join(f", {words}" for words in (*trial.settings, f"seed {trial.seed}"))
            console.print(plain(f"  {entry.pop('verb')} {entry}{where}: {finding.says}"), soft_wrap=True)
        if len(those) > _TOLD:
            console.print(plain(f"  and {len(those) - _TOLD} others, as long or longer"), soft_wrap=True)


def _plain(found: Flights, quarry: Quarry, file: Path) -> dict[str, object]:
    names = [one.name for one in quarry.make()]
    return {
        "certificate": str(file) if found.certain else None,
        "flown": found.flown,
        "put_nothing_to_the_test": found.untold,
        "broken": {
            names[number]: [
                {"settings": trial.settings, "seed": trial.seed, "fault": trial.faults[0], "finding": str(finding)}
                for trial, finding, _ in those
            ]
            for number, those in found.broken.items()
        },
    }
