"""What a person sees of a hunt: how it goes, what it found, and what it tried and did not."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import progress as bar
from rich.console import Console
from rich.table import Table

from affinet.cli.progress import Bar
from affinet.cli.show import plain
from affinet.testing import covered
from affinet.testing.covered import Coverage
from affinet.testing.hunt import Hunted, Quarry
from affinet.testing.menu import menu
from affinet.testing.trial import MOST_FAULTS, Trial

_TOLD = 6  # of what was never met, by name


class Progress:
    """How a hunt goes, on standard error."""

    def __init__(self, budget: int) -> None:
        self._budget = budget
        self._bar = Bar("hunting", budget, bar.BarColumn(), bar.TextColumn("{task.fields[says]}"))

    def __enter__(self) -> Progress:
        self._bar.__enter__()
        return self

    def __exit__(self, *failure: object) -> None:
        self._bar.__exit__(*failure)

    def see(self, coverage: Coverage, broken: Trial | None) -> None:
        """Show how far it is, and every schedule that breaks an invariant."""
        if broken is not None and not coverage.shrinking:
            self._bar.tell(f"breaks: {', '.join(entry['verb'] for entry in broken.entries)}")
        shrinking = f", {coverage.shrinking} to shrink" if coverage.shrinking else ""
        self._bar.see(min(coverage.schedules, self._budget), f"{coverage.schedules} flown{shrinking}")


def show(found: Hunted, names: Sequence[str], quarry: Quarry) -> None:
    """What a hunt has found, and what it tried."""
    console = Console()
    broken = {one.number: one for one in found.found}
    for number, name in enumerate(names):
        if number not in broken:
            console.print(
                plain(f"{name}: nothing found that breaks it" if len(names) > 1 else "nothing found that breaks it")
            )
            continue
        one = broken[number]
        console.print(plain(f"{one.finding}"))
        for words in (*one.trial.settings, *([f"seed {one.trial.seed}"] if len(quarry.seeds) > 1 else [])):
            console.print(plain(f"  {words}"))
        for entry in one.scenario.timeline[-len(one.trial.entries) :]:
            said = entry.model_dump(mode="json", exclude_none=True)
            console.print(plain(f"  {said.pop('verb')} {said}"))
    _coverage(console, found.coverage, quarry)


def as_json(found: Hunted, places: Sequence[Path], quarry: Quarry) -> dict[str, Any]:
    """What it came to, in plain values."""
    coverage = found.coverage
    return {
        "found": [
            {
                "invariant": one.finding.checker,
                "scenario": str(places[one.number]),
                "finding": str(one.finding),
                "digest": one.digest,
                "settings": list(one.trial.settings),
                "seed": one.trial.seed,
                "faults": list(one.trial.faults),
            }
            for one in found.found
        ],
        "tried": {
            "schedules": coverage.schedules,
            "vacuous": coverage.vacuous,
            "unfit": coverage.unfit,
            "shrinking": coverage.shrinking,
            "met": {kind: dict(sorted(coverage.of(kind).items())) for kind in covered.KINDS},
            "never": _never(coverage, quarry),
        },
    }


def _never(coverage: Coverage, quarry: Quarry) -> dict[str, list[str]]:
    return coverage.never(menu(next(iter(quarry.scenarios.values())), quarry.verbs), MOST_FAULTS)


def _coverage(console: Console, coverage: Coverage, quarry: Quarry) -> None:
    unfit = f", {coverage.unfit} were none of this scenario" if coverage.unfit else ""
    shrinking = f"; {coverage.shrinking} more to shrink what broke" if coverage.shrinking else ""
    console.print(
        plain(f"{coverage.schedules} schedules, {coverage.vacuous} could not tell{unfit}{shrinking}"), soft_wrap=True
    )
    table = Table("tried", "how often", "never tried")
    for kind, missing in _never(coverage, quarry).items():
        met = coverage.of(kind)
        ranked = sorted(met.items(), key=lambda item: (-item[1], item[0]))
        most = ranked if kind in (covered.VERB, covered.SELECTOR) else ranked[:_TOLD]
        rest = f", {len(ranked) - len(most)} others" if len(ranked) > len(most) else ""
        often = ", ".join(f"{name} {number}" for name, number in most) + rest
        more = f", and {len(missing) - _TOLD} more" if len(missing) > _TOLD else ""
        table.add_row(plain(kind), plain(often), plain(", ".join(missing[:_TOLD]) + more))
    console.print(table)
