"""`affinet render`: runs as a picture, or as a film, without a viewer."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich import progress as bar

from affinet.cli import moments
from affinet.cli.options.flown import STILL
from affinet.cli.progress import Bar
from affinet.runtimes import directories
from affinet.scenario.names import apart
from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import beside, pictured, reading
from analysis.figures import swarm
from analysis.figures.swarm import Flight
from analysis.models.arrays import Array
from netem.processes.system_errors import about

_MOST_FRAMES = 20_000


def render(parsed: argparse.Namespace) -> None:
    """Draw it, and say where.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When a directory holds no run that can be drawn, or there is nothing to write a film with.
    OSError
        When the file cannot be written.
    """
    directories.refuse_there(parsed.out)
    runs = [reading.evidence(directory) for directory in parsed.directories]
    titles = beside.titles(runs, apart(parsed.directories))
    flights = [pictured.flight(run, title) for run, title in zip(runs, titles, strict=True)]
    last = max(float(flight.seconds[-1]) for flight in flights)
    with about(parsed.out):
        if parsed.out.suffix in STILL:
            swarm.still(flights, moments.within("--at", last if parsed.at is None else parsed.at, last), parsed.out)
        else:
            _film(flights, _moments(parsed, last), parsed.fps, parsed.out)
    print(one_line(str(parsed.out)))  # noqa: T201


def _film(flights: Sequence[Flight], times: Array, frames_per_s: int, out: Path) -> None:
    try:
        with Bar(str(out), len(times), bar.BarColumn(), bar.TextColumn("{task.fields[says]}")) as shown:
            for number in swarm.film(flights, times, frames_per_s, out):
                shown.see(number + 1, f"{number + 1}/{len(times)} frames")
    except swarm.NoFilm as error:
        raise ScenarioError(str(error)) from error


def _moments(parsed: argparse.Namespace, last: float) -> Array:
    begins = moments.within("--from", parsed.begins, last)
    ends = last if parsed.ends is None else moments.within("--to", parsed.ends, last)
    if last == 0.0:
        raise ScenarioError(f"{parsed.out}: the run has one tick, which is no film; give a name that ends in .png")
    if ends <= begins:
        raise ScenarioError(f"--to {ends:g}: give a moment after --from {begins:g}")
    step = parsed.speed / parsed.fps
    if (ends - begins) / step > _MOST_FRAMES:
        raise ScenarioError(
            f"--speed {parsed.speed:g}: that would be more than {_MOST_FRAMES} frames; give a higher one"
        )
    times: Array = np.arange(begins, ends + 0.5 * step, step)
    return times
