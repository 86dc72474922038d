"""What each array of a run is: its axes in their order, its unit, what it says, and how it says that something is not there.

Every array of a run has its line here, and labels of exports and docs are made of it. `position` has one row more than there
are ticks: where the last one led.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from world.physics.world import World

TIME, AGENT, SLOT, LINK, CHANNEL, VERDICT = "time", "agent", "slot", "link", "channel", "verdict"
AXIS, PAIR, ROW, COLUMN, DERIVATIVE = "axis", "pair", "row", "column", "derivative"
AGE_OF_NEWS = "age_of_news"

# What stands along each axis.
AXES: Mapping[str, str] = {
    TIME: "the ticks",
    AGENT: "the agents, from 1",
    SLOT: "the neighbours of an agent by their numbers; who has fewer than others has padding at the end",
    LINK: "the directed links, by who hears, then by who is heard: 6->4 is what agent 4 measures and hears of agent 6",
    CHANNEL: "the channels, sensing first",
    VERDICT: "what can become of a message",
    AXIS: "x, y, and z in space",
    PAIR: "the upper triangle of a covariance, row by row: xx, xy, yy",
    ROW: "of a matrix, from 1",
    COLUMN: "of a matrix, from 1",
    DERIVATIVE: "by time, from 0",
}

_PER_SECOND = ("m", "m/s", "m/s2", "m/s3", "m/s4")


class Described(NamedTuple):
    """Of an array.

    Parameters
    ----------
    axes
        Their names, in order.
    unit
        As netCDF writes it, "1" of a pure number; "" where only who reports it knows.
    says
        What it is.
    kind
        Of its numbers, as NumPy calls it.
    absent
        The number that says that there is none; NaN always does.
    where
        Which array says where there is one; None where it is everywhere.
    """

    axes: tuple[str, ...]
    unit: str
    says: str
    kind: str = "f"
    absent: int | None = None
    where: str | None = None


BY_TICK: Mapping[str, Described] = {
    "position": Described((TIME, AGENT, AXIS), "m", "position"),
    "measured": Described(
        (TIME, LINK, AXIS),
        "m",
        "what the sensor says of where the agent is from its neighbour, whether it arrived or not",
    ),
    "input": Described((TIME, AGENT, AXIS), "m/s", "input that is flown"),
    "estimate": Described(
        (TIME, AGENT, SLOT, AXIS), "m", "estimate of where the agent is from its neighbour", where="known"
    ),
    "known": Described((TIME, AGENT, SLOT), "1", "whether there is an estimate", "b"),
    "covariance": Described((TIME, AGENT, SLOT, PAIR), "m2", "covariance of the estimate", where="known"),
    "psi": Described((TIME, AGENT), "1", "convergence indicator"),
    "feasible": Described(
        (TIME, AGENT),
        "1",
        "whether what is measured determines a local map; none of estimators that fit no map",
        "i",
        -1,
    ),
    "verdicts": Described((TIME, CHANNEL, LINK), "1", "what became of what was offered", "u"),
    "newest": Described((TIME, CHANNEL, LINK), "1", "the tick of which the newest speaks that arrives", "i", -1),
    "copies": Described((TIME,), "1", "messages that were doubled", "i"),
    "late": Described((TIME,), "1", "messages that arrived late", "i"),
    "dropped": Described((TIME, VERDICT), "1", "messages that were dropped under way", "i"),
    "target": Described((TIME, AGENT, AXIS), "m", "where the agent should be"),
    "error": Described((TIME,), "m2", "tracking error"),
}

# What no run keeps, as it is made of `newest`.
DERIVED: Mapping[str, Described] = {
    AGE_OF_NEWS: Described(
        (TIME, CHANNEL, LINK), "s", "how old the newest is that has arrived; nothing before any has"
    ),
}

# What the estimators of affinet report; behind the ticks and the agents, which all reports begin with.
REPORTS: Mapping[str, Described] = {
    "nis": Described((SLOT,), "1", "innovation squared, normalised by its covariance"),
    "theta": Described((ROW, COLUMN), "1", "the map Theta that the agent perceives"),
    "place": Described((AXIS,), "m", "where the agent finds itself"),
    "reference": Described(
        (DERIVATIVE, AXIS), "", "position (m) and derivatives of the target that the agent steers by"
    ),
    "found": Described((AXIS,), "m", "where the agent finds the target by itself"),
    "variance": Described((), "m2", "variance of the target's position that the agent steers by, per axis"),
    "information": Described((DERIVATIVE, "number"), "", "what the agent knows of the target by itself, packed"),
    "fused": Described((DERIVATIVE, "number"), "", "what was found of the target together, packed"),
    "sighting": Described((AXIS,), "m", "where a detection that is done puts the target"),
}


def of_run(world: World, reports: Mapping[str, tuple[int, ...]]) -> dict[str, Described]:
    """Every array of a run over this world, with what its estimators report: names, and the shape of each for one agent."""
    positions, order = world.sensor.says_positions, world.body.build().order
    units = {"measured": "m" if positions else "1", "input": _PER_SECOND[order]}
    of_ticks = {name: one._replace(unit=units.get(name, one.unit)) for name, one in BY_TICK.items()}
    return of_ticks | {name: _report(world, name, shape) for name, shape in reports.items()}


def _report(world: World, name: str, shape: tuple[int, ...]) -> Described:
    dimension = world.formation.dimension
    sizes = {SLOT: world.links.slots.shape[1], AXIS: dimension, ROW: dimension, COLUMN: dimension}
    known = REPORTS.get(name)
    if known is None or not _fits(known.axes, shape, sizes):
        axes = tuple(f"{name}_{number}" for number in range(1, len(shape) + 1))
        known = Described(axes, "", f"{name}, as the estimator reports it")
    return known._replace(axes=(TIME, AGENT, *known.axes))


def _fits(axes: tuple[str, ...], shape: tuple[int, ...], sizes: Mapping[str, int]) -> bool:
    """Whether an array of this shape may have these axes, as a report of the user's own of the same name may not."""
    return len(axes) == len(shape) and all(
        sizes.get(axis, size) == size for axis, size in zip(axes, shape, strict=True)
    )
