"""`affinet run --seeds` and `--sweep`: many runs of a scenario, and a table of what they came to."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from rich import progress as bar
from rich.console import Console

from affinet.cli import means, varied
from affinet.cli.notes import note
from affinet.cli.progress import Bar
from affinet.cli.show import plain
from affinet.runtimes.rehearsing import why_alone
from affinet.scenario.sections import Scenario
from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from affinet.studies import quantities, sweeping
from affinet.studies.sweeping import Setting
from affinet.verdicts import invariants

_VERDICTS = ("pass", "vacuous", "fail")
_OF_ONE_RUN = ("out", "view", "serve")
_TOLD = 5  # settings of which it is said what did not pass


def fly(parsed: argparse.Namespace, load: Callable[[Sequence[str]], Scenario]) -> bool:
    """Fly them, and print what they came to; whether all passed.

    Raises
    ------
    ScenarioError, PlanError
        When one of them cannot fly, or an option is of one run.
    UserCodeError
        When a user's own code does something wrong.
    """
    sweeps = varied.swept(parsed)
    of_one_run = [name for name in _OF_ONE_RUN if getattr(parsed, name)]
    if of_one_run or parsed.runtime == "processes":
        raise ScenarioError(
            f"--{(*of_one_run, 'runtime processes')[0]} is of one run, "
            "and --seeds, --sweep and --check fly many in this process: leave it out"
        )
    checker = None if parsed.check is None else invariants.parse(parsed.check)
    plans = sweeping.planned(load, sweeps, None if parsed.seeds is None else parsed.seeds.start)
    runs = 1 if parsed.seeds is None else len(parsed.seeds)
    if runs > 1:
        reasons = dict.fromkeys(filter(None, (why_alone(plan) for _, plan in plans)))
        for why in reasons:
            note(f"note: runs fly one by one, and not side by side: {why}")
    name = Path(parsed.scenario).stem
    with Bar(name, len(plans), bar.BarColumn(), bar.TextColumn("{task.fields[says]}"), says="starting") as shown:
        found = sweeping.fly(
            plans, runs, checker, load, lambda done: shown.see(done, f"{int(done)}/{len(plans)} settings")
        )
    if parsed.json:
        print(json.dumps(_plain(found, parsed.seeds), allow_nan=False))  # noqa: T201
    else:
        _print(name, found, runs)
    return all(setting.verdicts["pass"] == runs for setting in found)


def _plain(found: Sequence[Setting], seeds: range | None) -> dict[str, object]:
    quantity = found[0].quantity
    says, unit = quantities.said(quantity)
    return {
        "quantity": says,
        "unit": unit,
        "confidence": sweeping.CONFIDENCE,
        "seeds": None if seeds is None else [seeds.start, seeds.stop - 1],
        "settings": [
            {
                "set": dict(setting.labels),
                "mean": _finite(setting.mean.found),
                "low": _finite(setting.mean.low),
                "high": _finite(setting.mean.high),
                "values": [_finite(value) for value in setting.values.tolist()],
                "verdicts": dict(setting.verdicts),
                "first": None if setting.first is None else setting.first._asdict(),
                "alone": setting.alone,
            }
            for setting in found
        ],
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _print(name: str, found: Sequence[Setting], runs: int) -> None:
    says, unit = quantities.said(found[0].quantity)
    of_many = f", {runs} runs of each; {100 * sweeping.CONFIDENCE:g} % interval by Student's t" if runs > 1 else ""
    console = Console()
    console.print(plain(f"{name}: {says}, mean over each run{of_many}"), soft_wrap=True)
    rows = [
        means.Row(one.labels, one.mean.found, one.mean.low, one.mean.high, _verdicts(one.verdicts)) for one in found
    ]
    means.show(console, rows, unit, intervals=runs > 1)
    means.warn(console, found[0].quantity, rows)
    others = [(setting.labels, setting.first) for setting in found if setting.first is not None]
    for labels, first in others[:_TOLD]:
        where = ", ".join([f"seed {first.seed}", *(f"{key}={value}" for key, value in labels.items())])
        console.print(plain(one_line(f"{where}: {first.verdict}: {first.says}")), soft_wrap=True)
    if len(others) > _TOLD:
        console.print(plain(f"... and {len(others) - _TOLD} settings more; --json has them all"))


def _verdicts(counted: Mapping[str, int]) -> str:
    return ", ".join(f"{counted[verdict]} {verdict}" for verdict in _VERDICTS if counted.get(verdict))
