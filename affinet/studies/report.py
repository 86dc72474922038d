"""Where a study leaves what came of it, and the figures that it leaves."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from affinet.planning import phases
from affinet.planning.plan import Plan
from affinet.runtimes import directories
from affinet.studies import cells, record
from affinet.studies.batch import REPORT
from affinet.studies.judging import graph_rates
from affinet.studies.quantities import Quantity, over_time, said
from affinet.studies.record import CaseMean
from affinet.studies.study import Result, Study
from analysis.figures import curves, paths, sweeps, target
from analysis.figures.curves import Curve
from analysis.figures.target import TargetRun
from analysis.models.arrays import Array
from analysis.models.information import reported, unpacked
from netem.core.channels import PLACE

_MOST_FLIGHTS = 8  # in one picture
_NORMALISED = {"nees": "NEES", "nis": "NIS", "target_nees": "NEES of targets", "place_nees": "NEES of places"}


def prepare(out: Path | str) -> Path:
    """The directory for what a study leaves, made before anything flies: this one, or by default one of this name.

    One that holds a study which is not done is for the same study to go on in.

    Raises
    ------
    OSError
        When it holds a study already that is done, or it cannot be made.
    """
    if isinstance(out, str):
        return directories.for_study(out)
    out.mkdir(parents=True, exist_ok=True)
    if (out / record.FILE).exists() and not cells.unfinished(out):
        raise FileExistsError(f"{str(out)!r} holds a study already; name another directory with --out")
    return out


def failed(out: Path) -> Path | None:
    """Write down of what a report has just failed; the file that says so, if there is room for one."""
    log = out / "report.log"
    try:
        log.write_text(traceback.format_exc(), encoding="utf-8")
    except OSError:
        log.unlink(missing_ok=True)
        return None
    return log


def draw(out: Path, study: Study, results: list[Result]) -> None:
    """Draw the figures into a directory."""
    if any(claim.check == "slower_with_anchor" for claim in study.claims):
        curves.rates(out / "rates.png", study.title, graph_rates())
    if all(reported(one.runs.first) for one in results):
        _draw_pursuit(out, study, results)
    if all(PLACE in one.runs.first for one in results):
        curves.evolution(
            out / "evolution.png",
            study.title,
            [(one.labels, one.runs.seconds, one.runs.first[PLACE]) for one in results],
        )
    axes = [axis.name for axis in study.axes]
    for quantity in study.also:
        _draw_quantity(out / f"{quantity.removeprefix(REPORT)}.png", study, results, quantity)
    if study.figure == "curves":
        _draw_quantity(out / "figure.png", study, results, study.quantity)
        dimension = results[0].plan.world.formation.dimension
        normalised = {
            says: _curves(results, what, study.since)
            for what, says in _NORMALISED.items()
            if any(np.isfinite(one.runs.quantities[what]).any() for one in results)
        }
        if normalised:
            curves.consistency(out / "consistency.png", study.title, normalised, axes, dimension)
    elif study.figure == "sweep":
        _draw_quantity(out / "figure.png", study, results, study.quantity)
    elif study.figure == "map":
        curves.settings(out / "figure.png", study.title, _curves(results, study.quantity, study.since), axes)
    elif study.figure == "paths":
        paths.paths(out / "figure.png", study.title, [_path(one) for one in results])
    else:
        (one,) = results
        numbers = np.flatnonzero(one.followers)
        path, seen = out / "figure.png", one.runs.corrected[:, numbers]
        curves.indicator(
            path, study.title, one.runs.seconds, one.runs.quantities["error"], seen, (numbers + 1).tolist()
        )


def _draw_quantity(path: Path, study: Study, results: list[Result], quantity: Quantity) -> None:
    if study.along is None:
        axes, drawn = [axis.name for axis in study.axes], _curves(results, quantity, study.since)
        changing = [replace(curve, changes=_changes(one.plan)) for curve, one in zip(drawn, results, strict=True)]
        curves.curves(path, study.title, changing, axes, _said(quantity), _bound(study, quantity))
    else:
        means = [record.mean(one, quantity, study.since) for one in results]
        draw_means(path, study, means)


def draw_means(path: Path, study: Study, means: Sequence[CaseMean]) -> None:
    """Draw those of one quantity along the axis of a sweep, as they are in `claims.json` too.

    Parameters
    ----------
    path
        The file to draw.
    study, means
        The study, a sweep, and its means.
    """
    assert study.along is not None
    axes, quantity = [axis.name for axis in study.axes], means[0].quantity
    drawn = [sweeps.Mean(one.labels, *map(_number, (one.found, one.low, one.high))) for one in means]
    sweeps.sweep(path, study.title, drawn, axes, study.along, _said(quantity), _bound(study, quantity))


def _number(kept: float | None) -> float:
    return np.nan if kept is None else kept


def _said(quantity: Quantity) -> str:
    what, unit = said(quantity)
    return f"{what} ({unit})" if unit else what


def _bound(study: Study, quantity: Quantity) -> tuple[float, str] | None:
    return None if study.bound is None or quantity != study.quantity else (study.bound.at, study.bound.says)


def _path(one: Result) -> paths.Flight:
    links, first = one.plan.world.links, one.runs.first
    return paths.Flight(
        labels=one.labels,
        seconds=one.runs.seconds,
        position=first["position"],
        input=first["input"],
        edges=np.stack([links.src, links.dst], axis=-1) - 1,
        shown=int(np.flatnonzero(one.followers)[0]),
    )


def _draw_pursuit(out: Path, study: Study, results: list[Result]) -> None:
    if len(results) <= _MOST_FLIGHTS:
        target.pursued(out / "target.png", study.title, [_flight(one) for one in results])
    one, *_ = results
    fused, known = (_first_of_vector(one, one.runs.first[name]) for name in ("fused", "information"))
    if (fused != known).any():
        target.agreement(out / "agreement.png", study.title, one.runs.seconds, fused, known)


def _first_of_vector(one: Result, information: Array) -> Array:
    _, vectors = unpacked(information, one.plan.world.formation.dimension, information.shape[-2] - 1)
    return vectors[..., 0, 0]


def _flight(one: Result) -> TargetRun:
    first = one.runs.first
    return TargetRun(
        labels=one.labels,
        seconds=one.runs.seconds,
        target=first["target"],
        position=first["position"],
        places=one.plan.world.formation.nominal,
        found=first["found"],
        reference=first["reference"][:, :, 0],
    )


def _curves(results: list[Result], quantity: Quantity, since: float) -> list[Curve]:
    return [
        Curve(
            labels=one.labels,
            seconds=one.runs.seconds,
            error=one.runs.quantities[quantity],
            overall=over_time(one.runs, quantity, (since, None)),
        )
        for one in results
    ]


def _changes(plan: Plan) -> list[float]:
    """When its graph changes, in seconds."""
    return [phase.start * plan.world.dt for phase in phases.phases(plan.swarm, plan.world.links, plan.faults)[1:]]
