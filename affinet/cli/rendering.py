"""`affinet render`: runs as a picture, or as a film, without a viewer."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich import progress as bar

from affinet.cli.progress import Bar
from affinet.scenario.sections import ScenarioError
from affinet.scenario.words import one_line
from affinet.verdicts import pictured, reading
from analysis.models.arrays import Array
from netem.processes.system_errors import about

if TYPE_CHECKING:
    from analysis.figures.swarm import Flight

_STILL, _MOVING = (".png", ".pdf", ".svg", ".jpg"), (".mp4", ".gif")
_MOST_FRAMES = 20_000


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `render`."""
    render = commands.add_parser("render", help="a picture or a film of runs, for a paper or a page")
    render.add_argument("directories", nargs="+", type=Path, metavar="RUN", help="run directories, side by side")
    render.add_argument(
        "--out", required=True, type=_picture, metavar="FILE", help=f"ends in {', '.join((*_STILL, *_MOVING))}"
    )
    render.add_argument("--at", type=float, metavar="S", help="of a picture: which moment (default: the last)")
    render.add_argument(
        "--speed", type=_positive, default=4.0, metavar="X", help="of a film: times real time (default: %(default)g)"
    )
    render.add_argument(
        "--fps", type=int, default=15, choices=range(1, 61), metavar="N", help="frames a second (default: %(default)s)"
    )
    render.add_argument(
        "--from", dest="begins", type=float, default=0.0, metavar="S", help="of a film: its first moment"
    )
    render.add_argument("--to", dest="ends", type=float, metavar="S", help="of a film: its last moment")


def render(parsed: argparse.Namespace) -> None:
    """Draw it, and say where.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When a directory holds no run that can be drawn, or there is nothing to write a film with.
    OSError
        When the file cannot be written.
    """
    from analysis.figures import swarm  # matplotlib takes a while to import

    flights = [
        pictured.flight(reading.evidence(directory), directory.absolute().name) for directory in parsed.directories
    ]
    last = max(float(flight.seconds[-1]) for flight in flights)
    with about(parsed.out):
        if parsed.out.suffix in _STILL:
            swarm.still(flights, _within("--at", last if parsed.at is None else parsed.at, last), parsed.out)
        else:
            _film(flights, _moments(parsed, last), parsed.fps, parsed.out)
    print(one_line(str(parsed.out)))  # noqa: T201


def _film(flights: Sequence[Flight], moments: Array, frames_per_s: int, out: Path) -> None:
    from analysis.figures import swarm

    try:
        with Bar(str(out), len(moments), bar.BarColumn(), bar.TextColumn("{task.fields[says]}")) as shown:
            for number in swarm.film(flights, moments, frames_per_s, out):
                shown.see(number + 1, f"{number + 1}/{len(moments)} frames")
    except swarm.NoFilm as error:
        raise ScenarioError(str(error)) from error


def _moments(parsed: argparse.Namespace, last: float) -> Array:
    begins = _within("--from", parsed.begins, last)
    ends = last if parsed.ends is None else _within("--to", parsed.ends, last)
    if ends <= begins:
        raise ScenarioError(f"--to {ends:g}: give a moment after --from {begins:g}")
    step = parsed.speed / parsed.fps
    if (ends - begins) / step > _MOST_FRAMES:
        raise ScenarioError(
            f"--speed {parsed.speed:g}: that would be more than {_MOST_FRAMES} frames; give a higher one"
        )
    moments: Array = np.arange(begins, ends + 0.5 * step, step)
    return moments


def _within(option: str, seconds: float, last: float) -> float:
    if not 0.0 <= seconds <= last:
        raise ScenarioError(f"{option} {seconds:g}: give a moment from 0 to {last:g} s")
    return seconds


def _picture(text: str) -> Path:
    path = Path(text)
    if path.suffix not in (*_STILL, *_MOVING):
        raise argparse.ArgumentTypeError(f"{text!r}: give a name that ends in {', '.join((*_STILL, *_MOVING))}")
    return path


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-3 <= value <= 1e6:
        raise argparse.ArgumentTypeError(f"{text!r}: give a number from 0.001 to 1e6")
    return value
