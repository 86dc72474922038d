"""`affinet hunt --frontier`: a picture of which outages break an invariant, and how often."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping

import numpy as np
from rich import progress as bar

from affinet.cli.notes import note
from affinet.cli.progress import Bar
from affinet.cli.quarry import flown_by, quarry_of
from affinet.cli.status import FAIL, PASS
from affinet.runtimes import directories
from affinet.scenario.wrong import ScenarioError
from affinet.testing.frontier import CONFIDENCE, Frontier, fly_frontier, of_one_setting
from affinet.testing.hunt import Quarry
from analysis.figures.frontier import frontier as draw
from analysis.models.arrays import Array
from netem.processes.system_errors import about

_OTHER = ("verbs", "budget", "corpus", "sweep", "out")


def fly_and_draw(parsed: argparse.Namespace) -> int:
    """Fly a grid of outages, and leave a picture of what they break.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, OSError
        When it cannot begin, or the picture not be written.
    """
    if others := [name for name in _OTHER if getattr(parsed, name)]:
        raise ScenarioError(f"--frontier and --{others[0]}: it cuts links of one scenario, and draws; leave one out")
    numbers = parsed.frontier.with_suffix(".json")
    directories.refuse_nowhere(parsed.frontier, "--frontier")
    for file in (parsed.frontier, numbers):
        directories.refuse_there(file, "--frontier")
    quarry = of_one_setting(quarry_of(parsed))
    with Bar("frontier", 1, bar.BarColumn(), bar.TextColumn("{task.fields[says]}")) as shown:
        found = fly_frontier(quarry, flown_by(parsed.jobs), lambda done, of: shown.see(done / of, f"{done}/{of} flown"))
    names = [one.name for one in quarry.make()]
    given = next(iter(quarry.scenarios.values()))
    cells = [_cells(found, number) for number in range(len(names))]
    title = (
        f"{given.agents.estimator}, {given.agents.law}: links cut at random from {found.at:g} s on; {len(quarry.seeds)} "
        f"seeds in each cell, with {100 * CONFIDENCE:g} % intervals"
    )
    with about(parsed.frontier):
        draw(parsed.frontier, title, found.links, found.seconds, list(zip(names, cells, strict=True)))
    says = _plain(found, dict(zip(names, cells, strict=True)), quarry)
    with about(numbers):
        numbers.write_text(json.dumps(says, indent=1) + "\n", encoding="utf-8")
    for name, shares in zip(names, cells, strict=True):
        print(f"{name}: {_least(found, shares)}")  # noqa: T201
    print(f"{parsed.frontier}, and its numbers: {numbers}")  # noqa: T201
    if parsed.json:
        print(json.dumps(says))  # noqa: T201
    untold = [name for name, told in zip(names, found.told, strict=True) if not told.any()]
    for name in untold:
        note(f"{name}: no run put it to the test, which proves nothing")
    return FAIL if untold else PASS


def _cells(found: Frontier, number: int) -> Array:
    """Share, lower and upper end of each cell, shape (3, links, seconds)."""
    shares = np.full((3, len(found.links), len(found.seconds)), np.nan)
    for row, column in np.ndindex(*shares.shape[1:]):
        if found.told[number, row, column]:
            share = found.share(number, row, column)
            shares[:, row, column] = share.found, share.low, share.high
    return shares


def _least(found: Frontier, shares: Array) -> str:
    """From which length on half of the runs break it, for each number of links."""
    said = []
    for number, row in zip(found.links, shares[0], strict=True):
        first = next((seconds for seconds, share in zip(found.seconds, row, strict=True) if share >= 0.5), None)
        said.append(f"{number} link{'s' if number > 1 else ''} {'never' if first is None else f'{first:g} s'}")
    return f"half of the runs break it from {', '.join(said)} on"


def _plain(found: Frontier, cells: Mapping[str, Array], quarry: Quarry) -> dict[str, object]:
    return {
        "at": found.at,
        "links": found.links,
        "seconds": found.seconds,
        "seeds": list(quarry.seeds),
        "confidence": CONFIDENCE,
        "invariants": {
            name: {
                "broke": found.broke[number].tolist(),
                "told": found.told[number].tolist(),
                **{key: _or_none(values) for key, values in zip(("share", "low", "high"), shares, strict=True)},
            }
            for number, (name, shares) in enumerate(cells.items())
        },
    }


def _or_none(values: Array) -> list[list[float | None]]:
    """JSON has no NaN."""
    return [[None if np.isnan(value) else value for value in row] for row in values.tolist()]
