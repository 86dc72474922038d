"""The data of a study as labelled arrays, in one netCDF file: what xarray opens.

Its dimensions are the axes of the study, `run` and `time`. Each quantity is there as what stands for a run over its time, and
as mean and standard deviation over the runs in each moment. What no case has is left out, what some have not is NaN.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from affinet.studies.batch import REPORT
from affinet.studies.quantities import NAMES, over_time, said, stands_for
from affinet.verdicts.export import netcdf
from affinet.verdicts.export.labelled import Variable
from analysis.models.arrays import Array
from netem.processes.whole import whole

if TYPE_CHECKING:
    from affinet.studies.study import Result, Study

FILE = "results.nc"
# The dimension of moments: where all cases share them, and where they do not.
_TIME, _MOMENT = "time", "moment"
_NAME = re.compile(r"[^\x00-/:-@\[-^`{-\x7f][^\x00-\x1f/\x7f]*(?<! )")


def is_name(name: str) -> bool:
    """Whether netCDF has this for the name of a dimension or of a variable."""
    return _NAME.fullmatch(name) is not None


def is_number(label: str) -> bool:
    """Whether a label is a number."""
    try:
        return math.isfinite(float(label))
    except ValueError:
        return False


def taken() -> set[str]:
    """Names in every file, which no axis can have."""
    quantities = {f"{what}{_named(name)}" for name in NAMES for what in ("", "mean_", "std_")}
    return {"run", _TIME, _MOMENT, "tick_length", "tick_count"} | quantities


def write(out: Path, study: Study, results: Sequence[Result], about: Mapping[str, str]) -> None:
    """Write what came of the cases that have flown into a directory, whole or not at all.

    Parameters
    ----------
    out, study, results
        Where, of which study, and what came of its cases: of one at least.
    about
        What is to be known of it beside its own words.
    """
    import h5netcdf  # takes a while to import

    coordinates = _coordinates(study, results)
    variables = coordinates | dict(_quantities(study, results, coordinates))
    words = {"title": study.title, "source": study.source, "scenario": study.scenario, "since": study.since}
    with whole(out / FILE) as unfinished, h5netcdf.File(unfinished, "w") as file:
        file.attrs.update(words | dict(about))
        file.dimensions = {
            name: length for one in variables.values() for name, length in zip(one.axes, one.values.shape, strict=True)
        }
        for name, one in variables.items():
            netcdf.create(file, name, one)[...] = one.values


def _coordinates(study: Study, results: Sequence[Result]) -> dict[str, Variable]:
    axes = {axis.name: Variable([axis.name], _labels(list(axis.values)), {}) for axis in study.axes}
    first, *others = results
    seeds = np.uint64(first.plan.scenario.seed) + np.arange(len(first.runs.mean_error), dtype=np.uint64)
    seconds = {"units": "s", "long_name": "time"}
    if all(np.array_equal(first.runs.seconds, other.runs.seconds) for other in others):
        time = Variable([_TIME], first.runs.seconds, seconds)
    else:
        by_case = _by_case(study, results, [one.runs.seconds for one in results])
        time = Variable([*axes, _MOMENT], by_case, seconds)
    dt, ticks = [one.plan.world.dt for one in results], [float(one.plan.world.ticks) for one in results]
    return {
        **axes,
        "run": Variable(["run"], seeds, {"long_name": "seed"}),
        _TIME: time,
        "tick_length": _of_case(study, results, dt, {"units": "s", "long_name": "length of a tick"}),
        "tick_count": _of_case(study, results, ticks, {"units": "1", "long_name": "ticks of a run"}),
    }


def _of_case(
    study: Study, results: Sequence[Result], values: Sequence[float], attributes: Mapping[str, str]
) -> Variable:
    """A number of each case, or one for all."""
    if len(set(values)) == 1:
        return Variable([], np.array(values[0]), attributes)
    by_case = _by_case(study, results, [np.array([value]) for value in values])
    return Variable([axis.name for axis in study.axes], by_case[..., 0], attributes)


def _labels(labels: Sequence[str]) -> NDArray[Any]:
    """Labels of an axis; as numbers if they are numbers, each another one."""
    if all(map(is_number, labels)) and len(set(map(float, labels))) == len(labels):
        return np.array([float(label) for label in labels])
    return np.array(labels, dtype=object)


def _quantities(
    study: Study, results: Sequence[Result], coordinates: Mapping[str, Variable]
) -> Iterator[tuple[str, Variable]]:
    for quantity in dict.fromkeys(name for one in results for name in one.runs.quantities):
        having = [one for one in results if not np.isnan(one.runs.quantities.get(quantity, np.nan)).all()]
        if having:
            for name, one in _summed_up(study, having, quantity, coordinates[_TIME].axes[-1]):
                beside = _coordinates_of(one, coordinates)
                yield name, one._replace(attributes={**one.attributes, **_unit(quantity), **beside})


def _summed_up(study: Study, results: Sequence[Result], quantity: str, moments: str) -> Iterator[tuple[str, Variable]]:
    """Over the time of each run; and over the runs in each moment."""
    axes, name, says = [axis.name for axis in study.axes], _named(quantity), said(quantity)[0]
    over = stands_for(quantity)
    since = f" from {study.since:g} s on" if study.since else ""
    with np.errstate(invalid="ignore", over="ignore"):  # of runs that have diverged
        of_runs = [over_time(one.runs, quantity, (study.since, None)) for one in results]
        attributes = {
            "long_name": f"{says}, {over.replace('_', ' ')} over time{since}",
            "cell_methods": f"time: {over}",
        }
        yield name, Variable([*axes, "run"], _by_case(study, results, of_runs), attributes)
        for what, statistic, make in (("mean", "mean", np.mean), ("std", "standard_deviation", np.std)):
            of_moments = [make(one.runs.quantities[quantity], axis=0) for one in results]
            attributes = {
                "long_name": f"{says}, {statistic.replace('_', ' ')} over the runs",
                "cell_methods": f"run: {statistic}",
            }
            yield f"{what}_{name}", Variable([*axes, moments], _by_case(study, results, of_moments), attributes)


def _coordinates_of(one: Variable, coordinates: Mapping[str, Variable]) -> dict[str, str]:
    """Those beside its dimensions, as the conventions of netCDF (CF) say them."""
    beside = [name for name, other in coordinates.items() if name not in other.axes and {*other.axes} <= {*one.axes}]
    return {"coordinates": " ".join(beside)}


def _unit(quantity: str) -> dict[str, str]:
    """Its unit, 1 of a number; of a report who reports it alone knows that."""
    return {} if quantity.startswith(REPORT) else {"units": said(quantity)[1] or "1"}


def _named(quantity: str) -> str:
    """What a quantity is called among others."""
    return "tracking_error" if quantity == "error" else quantity


def _by_case(study: Study, results: Sequence[Result], rows: Sequence[Array]) -> Array:
    """A row of each of these cases in its place over the axes; NaN where there is no case, or its row ends."""
    axes = [list(axis.values) for axis in study.axes]
    places = {labels: place for place, labels in enumerate(itertools.product(*axes))}
    values = np.full((len(places), max(map(len, rows))), np.nan)
    for one, row in zip(results, rows, strict=True):
        values[places[tuple(one.labels[axis.name] for axis in study.axes)], : len(row)] = row
    return values.reshape(*map(len, axes), -1)
