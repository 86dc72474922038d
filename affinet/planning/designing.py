"""Nodes, a range and a time to settle -> a scenario with edges, leaders and stress (`affinet design`)."""

from __future__ import annotations

import re
from math import ceil
from pathlib import Path
from typing import NamedTuple

import numpy as np

from affinet.scenario.bounds import LARGEST
from affinet.scenario.sections import Scenario
from affinet.scenario.words import shown
from affinet.scenario.wrong import ScenarioError
from analysis.models.arrays import Array
from world.formation import layouts
from world.formation.design import design
from world.formation.layouts import KINDS
from world.formation.nominal import Formation, NotRigid

_GAIN = 10.0  # of the law in the scenario, per second
_TICK = 0.05  # s: half of what the fastest mode takes, at this gain
_FLAT = 1e-9  # of the swarm's size: less is a rounding of a line or a plane
_MOST = 10_000  # nodes: ten times as many as were ever tried take minutes
_SETTLED, _LONGEST = 4.0, 3600.0  # a run lasts so many times what it takes to 1/e, an hour at the most


class Designed(NamedTuple):
    """A scenario, its formation, and how long that takes to settle to 1/e, in seconds."""

    scenario: Scenario
    formation: Formation
    settles: float


def designed(nominal: Array, reach: float, settle: float) -> Designed:
    """A hovering swarm under the static law, with weights of its own.

    Parameters
    ----------
    nominal
        Nominal positions, shape (N, D), in metres.
    reach
        Range, in metres.
    settle
        Within how many seconds what is slowest falls to 1/e, at the gain of the law.

    Raises
    ------
    ScenarioError
        When no such design is found, with the way out.
    """
    least = nominal.shape[1] + 2
    if len(nominal) < least:
        raise ScenarioError(f"{len(nominal)} nodes: a stress in {least - 2} dimensions needs {least} at least")
    _refuse_flat(nominal)
    try:
        formation, smallest = design(nominal, reach, 1.0 / (_GAIN * settle))
    except NotRigid as error:
        raise ScenarioError(f"--range {reach:g}: {error}; give a longer range") from error
    except ValueError as error:
        raise ScenarioError(f"--settle {settle:g}: {error}; give more time") from error
    assert formation.weights is not None
    duration = ceil(min(_SETTLED * settle, _LONGEST) / _TICK) * _TICK
    said = {
        "description": f"{len(nominal)} agents within {reach:g} m of each other, designed to settle to 1/e in {settle:g} s",
        "formation": {
            "nodes": nominal.tolist(),
            "edges": [f"{i}-{j}" for i, j in formation.edges],
            "leaders": list(formation.leaders),
            "weights": formation.weights[:, 0].tolist(),
        },
        "manoeuvre": {"preset": "hover"},
        "time": {"dt": _TICK, "duration": round(duration, 6)},
        "sensing": {"sigma": 0.1},
        "agents": {"estimator": "none", "law": "static", "parameters": {"static": {"alpha": _GAIN}}},
    }
    return Designed(Scenario.model_validate(said), formation, 1.0 / (_GAIN * smallest))


def _refuse_flat(nominal: Array) -> None:
    places, first = np.unique(nominal, axis=0, return_index=True)
    if len(places) < len(nominal):
        twice = min(set(range(len(nominal))).difference(first.tolist()))
        raise ScenarioError(f"node {twice + 1} stands where another does, at {shown(nominal[twice].tolist())}; move it")
    spread = np.linalg.svd(nominal - nominal.mean(axis=0), compute_uv=False)
    if spread[-1] <= _FLAT * spread[0]:
        what = "in a line" if nominal.shape[1] == 2 else "in a plane"
        raise ScenarioError(f"all nodes lie {what}: no stress has their affine maps alone; move some out of it")


def nodes(kind: str, agents: int | None, dimension: int | None, seed: int) -> Array:
    """Nominal positions, shape (N, D), in metres.

    Parameters
    ----------
    kind
        One of `KINDS`, or the path of a file with a node in each line.
    agents, dimension
        How many of a kind, and in how many dimensions, 2 where nothing is said; a file has its own.
    seed
        Of random nodes.

    Raises
    ------
    ScenarioError
        When there are none of this kind, or the file says something else.
    """
    if kind not in KINDS:
        if agents is not None or dimension is not None:
            raise ScenarioError(
                f"--agents, --dimension: {kind} has nodes of its own; give them with {' or '.join(KINDS)}"
            )
        return _read(Path(kind))
    if agents is None:
        raise ScenarioError(f"--agents: how many there are in the {kind}?")
    if not 0 < agents <= _MOST:
        raise ScenarioError(f"--agents {agents}: from 1 to {_MOST}")
    if kind == "grid":
        return layouts.grid(agents, dimension or 2)
    return layouts.strewn(agents, dimension or 2, seed)


def _read(path: Path) -> Array:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise ScenarioError(
            f"{path}: no such file; give one with a node in each line, or {' or '.join(KINDS)}"
        ) from error
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not UTF-8: {error}") from error
    found: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not (words := re.split(r"[,;\s]+", line.partition("#")[0].strip(" \t,;"))) or words == [""]:
            continue
        try:
            node = [float(word) for word in words]
        except ValueError as error:
            raise ScenarioError(f"{path}:{number}: {shown(line)} is no node; write 1.0, 2.0") from error
        if len(node) not in (2, 3) or (found and len(node) != len(found[0])):
            raise ScenarioError(f"{path}:{number}: nodes need two coordinates each, or three each, got {shown(line)}")
        if not all(abs(coordinate) <= LARGEST for coordinate in node):
            raise ScenarioError(f"{path}:{number}: coordinates are at most {LARGEST:g} m in size, got {shown(line)}")
        found.append(node)
    if not found:
        raise ScenarioError(f"{path}: no nodes; write one in each line, like 1.0, 2.0")
    return np.array(found)
