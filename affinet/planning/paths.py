"""Paths in a CSV file: of the formation as a whole (time,x,y), or of each leader (time,leader,x,y); in space with z."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from affinet.traces.fields import number
from analysis.models.affine import Manoeuvre
from analysis.models.arrays import Array
from netem.impairments import measured
from netem.impairments.measured import MeasuredError, shown
from world.formation import manoeuvre
from world.formation.nominal import Formation

_AXES = ("x", "y", "z")
_FARTHEST_OFF = 0.01  # m, of a leader from where the affine map of all leaders has it


class _Path(NamedTuple):
    """A way through points: when it is where, in seconds and metres, and the line of each point."""

    line: list[int]
    time: list[float]
    point: list[list[float]]


def manoeuvre_of(file: Path, formation: Formation, seconds: Array, dt: float) -> Manoeuvre:
    """The manoeuvre of a file, its paths joined by monotone cubics, at rest before and after.

    Parameters
    ----------
    file
        Which.
    formation
        Who flies: a path of all is that of the origin of the nominal positions, one of each leader is its own.
    seconds, dt
        Times of the ticks, shape (T,), and the time between them.

    Raises
    ------
    MeasuredError
        When it is no such file, or its paths are of no affine map of the formation.
    OSError
        When it cannot be read.
    """
    paths = _read(file, formation.dimension, dt)
    if set(paths) == {0}:
        offset = _flown(paths[0], seconds)
        identity = np.broadcast_to(np.eye(formation.dimension), (len(seconds), *np.eye(formation.dimension).shape))
        return Manoeuvre(identity.copy(), offset)
    leaders = formation.leaders
    for leader, path in paths.items():
        if leader not in leaders:
            raise MeasuredError(f"line {path.line[0]}: agent {leader} leads nobody; leaders are {_named(leaders)}")
    if missing := [leader for leader in leaders if leader not in paths]:
        raise MeasuredError(f"leader {missing[0]} has no path: give one to each of {_named(leaders)}")
    flown = np.stack([_flown(paths[leader], seconds) for leader in leaders], axis=1)
    nominal = formation.nominal[np.array(leaders) - 1]
    if np.linalg.matrix_rank(nominal - nominal[0]) < formation.dimension:
        raise MeasuredError(
            f"the leaders {_named(leaders)} do not span the {formation.dimension} dimensions: their paths leave open where "
            "the others fly; give one path for all (time,x,y)"
        )
    found, off = manoeuvre.led_by(nominal, flown)
    tick, place = np.unravel_index(int(np.argmax(off)), off.shape)
    if off[tick, place] > _FARTHEST_OFF:
        raise MeasuredError(
            f"at {seconds[tick]:g} s leader {leaders[place]} is {off[tick, place]:.2g} m off the affine map of all leaders: "
            "their paths must be affine images of the nominal formation"
        )
    return found


def _read(file: Path, dimension: int, dt: float) -> Mapping[int, _Path]:
    """The paths by leader, or that of all as 0."""
    lines = measured.read(file)
    wanted = _AXES[:dimension]
    heading = [name.strip().lower() for name in (lines.texts[0] if lines.texts else "").split(",")]
    with_leaders = "leader" in heading
    if sorted(heading) != sorted(["time", *wanted, *(["leader"] if with_leaders else [])]):
        first = shown(lines.texts[0]) if lines.texts else "none"
        raise MeasuredError(
            f"line {lines.numbers[0] if lines.numbers else 1}: the columns must be time,{','.join(wanted)}, or with leader, "
            f"got {first}"
        )
    paths: dict[int, _Path] = {}
    rows = lines.after(1)
    for line, text in zip(*rows, strict=True):
        cells = next(csv.reader([text]), [])
        if len(cells) != len(heading):
            raise MeasuredError(f"line {line}: {len(heading)} cells are due, got {shown(text)}")
        said = dict(zip(heading, cells, strict=True))
        leader = number(line, said["leader"], "a leader", least=1.0) if with_leaders else 0.0
        if leader % 1.0:
            raise MeasuredError(f"line {line}: a leader is the number of an agent, got {shown(said['leader'])}")
        time = number(line, said["time"], "a time in s", least=0.0)
        path = paths.setdefault(int(leader), _Path([], [], []))
        if path.time and time < path.time[-1] + dt:
            raise MeasuredError(
                f"line {line}: {time:g} s is less than a tick ({dt:g} s) after the point before it ({path.time[-1]:g} s)"
            )
        path.line.append(line)
        path.time.append(time)
        path.point.append([number(line, said[axis], f"{axis} in m") for axis in wanted])
    for leader, path in paths.items():
        if len(path.time) < 2:
            whose = f"leader {leader}" if leader else "the formation"
            raise MeasuredError(f"line {path.line[0]}: the path of {whose} has one point: give at least two")
    if not paths:
        raise MeasuredError("there is no point in it: give at least two")
    return paths


def _flown(path: _Path, seconds: Array) -> Array:
    return np.asarray(manoeuvre.course(seconds, path.time, np.array(path.point), 1)[:, 0])


def _named(leaders: tuple[int, ...]) -> str:
    return ", ".join(map(str, leaders))
