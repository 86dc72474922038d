"""Files of link data as the air of a run: which node is which agent, and what each link is worth when."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from affinet.scenario import reaches
from affinet.scenario.sections import TimeSection
from affinet.scenario.trace_files import TraceFile
from affinet.traces import curves, formats, movement
from affinet.traces.curves import Curve
from affinet.traces.link_data import INDIRECT, UNITS, LinkData, Quantity, Steps
from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.core.listing import listed
from netem.impairments.measured import MeasuredError
from netem.impairments.trace import Measured

_USUAL_INTERVAL = 1.0  # s, of ping
_MOST_LOOKS = 10_000_000  # how far nodes are apart, over all pairs and times
_MOST_ROWS = 20_000_000  # of what begins anew, over the run and all links
_LONGEST_NUMBER = 9  # digits of an agent


def measured(
    file: TraceFile, what: Quantity, links: Links, rows: Mask, time: TimeSection
) -> tuple[Measured, list[str]]:
    """What a file says of a run's links, and what is to be said of it.

    Parameters
    ----------
    file, what
        Which, with its meaning, and what is asked of it: availability, delay or rate.
    links, rows
        The links of the formation, and the ones that need it, shape (L,).
    time
        Of the run.

    Raises
    ------
    MeasuredError
        When it does not say it, or of other links.
    OSError
        When it cannot be read.
    """
    name, data, notes = _read(file)
    more: list[str] = []
    if data.paths and what is Quantity.AVAILABILITY:
        given = _by_distance(data, file, links, rows, time)
    else:
        given, more = _of_links(_worth(data, what, file, name), data, file, links, rows)
    if what is Quantity.AVAILABILITY and data.everybody:
        given = _down_at_first(given, rows)
    if data.period is not None:
        return _again_and_again(given, data.period, time), [*notes, *more]
    return given, [*notes, *more, *_at_its_end(given, rows, time)]


def said_delays(file: TraceFile) -> Array:
    """All delays that a file says, in seconds, whenever and wherever they held, shape (n,).

    Raises
    ------
    MeasuredError
        When it says none.
    OSError
        When it cannot be read.
    """
    name, data, _ = _read(file)
    return _worth(data, Quantity.DELAY, file, name).value


def told(file: TraceFile, every: float) -> tuple[str, LinkData, list[str]]:
    """The format of a file, what it says, with what a curve makes of it, and what is taken to be so.

    Parameters
    ----------
    file
        Which, with its meaning.
    every
        At which times to look how far nodes that move are apart, in seconds.

    Raises
    ------
    MeasuredError
        When it cannot be understood, or would take too many looks.
    OSError
        When it cannot be read.
    """
    name, data, notes = _read(file)
    if data.paths:
        pairs = len(data.paths) * (len(data.paths) - 1)
        if (looks := data.ends / every * pairs) > _MOST_LOOKS:
            raise MeasuredError(
                f"{len(data.paths)} nodes up to {data.ends:.10g} s are {looks:.3g} looks, one each {every:g} s: at most "
                f"{_MOST_LOOKS} are taken; give a larger --dt, or --begins where they do not begin at 0"
            )
        time: Array = np.arange(0.0, data.ends + every / 2.0, every)
        data = replace(data, steps={Quantity.DISTANCE: movement.between_all(data.paths, time)})
    if file.curve is not None:
        worth = _worth(data, Quantity.AVAILABILITY, file, name)
        data = replace(data, steps={**data.steps, Quantity.AVAILABILITY: worth})
    return name, data, notes


def curve_of(said: object) -> Curve:
    """What a scenario says of a curve as a function."""
    match said:
        case reaches.Disk():
            return curves.Ramp(said.range, said.range)
        case reaches.Ramp():
            return curves.Ramp(said.inner, said.outer)
        case reaches.LogDistance():
            return curves.LogDistance(said.range, said.exponent, said.shadowing)
    assert isinstance(said, list)
    return curves.Points(said)


def _read(file: TraceFile) -> tuple[str, LinkData, list[str]]:
    """The format, what the file says from where the run begins, and what is taken to be so."""
    name, data = formats.read(Path(file.file), file.format)
    data, notes = _in_seconds(data, file)
    if data.period is None and file.begins > data.ends:
        raise MeasuredError(f"begins = {file.begins:.10g}, and it ends at {data.ends:.10g} s: give a time of the file")
    data = data.begun(file.begins)
    notes += data.assumed
    if (starts := data.starts) > max(0.0, data.ends - starts):
        notes.append(
            f"it says nothing before {starts:.10g} s, longer than all it tells of: begins = {starts:.10g} begins there"
        )
    return name, data, notes


def _in_seconds(data: LinkData, file: TraceFile) -> tuple[LinkData, list[str]]:
    if not data.paced:
        if file.interval is not None:
            raise MeasuredError("its times are in seconds: leave out interval")
        return data, []
    if file.interval is not None:
        return data.sent_every(file.interval), []
    said = f"it does not say when messages were sent: one every {_USUAL_INTERVAL:g} s is taken, interval = ... says otherwise"
    return data.sent_every(_USUAL_INTERVAL), [said]


def _worth(data: LinkData, what: Quantity, file: TraceFile, name: str) -> Steps:
    """The steps of a quantity, by the curve where there is no other way."""
    if what in data.steps:
        if file.curve is not None:
            raise MeasuredError(f"it says {what} itself: leave out curve")
        return data.steps[what]
    indirect = [one for one in INDIRECT if one in data.steps]
    if what is not Quantity.AVAILABILITY or not indirect:
        told = listed(f"{one}" for one in data.steps) if data.steps else "positions"
        raise MeasuredError(f"a file of format {name} that says {told}, and no {what}: name one that does")
    if file.curve is None:
        unit = UNITS[indirect[0]]
        raise MeasuredError(
            f"it says {indirect[0]}: how much passes at so many {unit}? say it by curve = [[{unit}, availability], ...]"
        )
    if not isinstance(file.curve, list) and indirect[0] is not Quantity.DISTANCE:
        raise MeasuredError(f"it says {indirect[0]}, and the curve is one by distance: give points")
    held = data.steps[indirect[0]]
    return held._replace(value=curve_of(file.curve)(held.value))


def _agents(data: LinkData, file: TraceFile, links: Links, lines: Integers | None = None) -> Integers:
    """Which agent each node is, 0 of those that are left out, shape (nodes,)."""
    if file.agents is not None:
        for name, agent in file.agents.items():
            if name not in data.nodes:
                raise MeasuredError(f"agents: it has no node {name!r}; it has {listed(data.nodes)}")
            if not 1 <= agent <= links.agents:
                raise MeasuredError(f"agents: {name!r} cannot be agent {agent}: there are {links.agents}")
        return np.array([file.agents.get(name, 0) for name in data.nodes], dtype=np.int64)
    agents = [
        int(name) - file.first + 1 if name.isdecimal() and len(name) <= _LONGEST_NUMBER else -1 for name in data.nodes
    ]
    for place, (name, agent) in enumerate(zip(data.nodes, agents, strict=True)):
        if not 1 <= agent <= links.agents:
            where = "" if lines is None or not lines[place] else f"line {lines[place]}: "
            raise MeasuredError(
                f"{where}node {name} is none of the agents 1 to {links.agents}: say which nodes are by "
                f"agents = {{ {name!r} = 1, ... }}, or by first = the number of agent 1"
            )
    return np.array(agents, dtype=np.int64)


def _of_links(steps: Steps, data: LinkData, file: TraceFile, links: Links, rows: Mask) -> tuple[Measured, list[str]]:
    if data.one_link:
        wanted = np.flatnonzero(rows)
        said = [f"it tells of one link: the {len(wanted)} links that have it are all worth the same at a time"]
        times = np.tile(steps.time, len(wanted))
        return Measured(times, np.repeat(wanted, len(steps.time)), np.tile(steps.value, len(wanted))), said[
            : len(wanted) > 1
        ]
    agent = _agents(data, file, links, _first_lines(steps, len(data.nodes)))
    src, dst = agent[steps.src], agent[steps.dst]
    row_of = np.full((links.agents + 1, links.agents + 1), -1)
    row_of[links.src, links.dst] = np.arange(len(links))
    link = row_of[src, dst]
    known = (src > 0) & (dst > 0)
    strange = known & (link < 0)
    if not data.everybody:
        for place in np.flatnonzero(strange)[:1]:
            pair = f"{data.nodes[steps.src[place]]}->{data.nodes[steps.dst[place]]}"
            raise MeasuredError(f"line {steps.line[place]}: {pair} is not a link of the formation: leave it out")
    others = len(set(zip(src[strange].tolist(), dst[strange].tolist(), strict=True)))
    said = [f"{others} pairs are in it that are no links of the formation: they are left out"] if others else []
    inside = link >= 0
    return Measured(steps.time[inside], link[inside], steps.value[inside]), said


def _first_lines(steps: Steps, nodes: int) -> Integers:
    lines = np.zeros(nodes, dtype=np.int64)
    for ends in (steps.dst[::-1], steps.src[::-1]):
        lines[ends] = steps.line[::-1]
    return lines


def _by_distance(data: LinkData, file: TraceFile, links: Links, rows: Mask, time: TimeSection) -> Measured:
    """By where nodes are when each tick begins, as a loss by distance has it."""
    if file.curve is None:
        raise MeasuredError('it says where nodes are: how far do they reach? curve = { model = "disk", range = 20.0 }')
    agent = _agents(data, file, links).tolist()
    path = {number: one for number, one in zip(agent, data.paths, strict=True) if number}
    wanted = np.flatnonzero(rows)
    if missing := sorted({*links.src[wanted].tolist(), *links.dst[wanted].tolist()} - path.keys()):
        raise MeasuredError(f"it does not say where agent {missing[0]} is: add a node, or say which is it by agents")
    ticks: Array = np.arange(time.ticks, dtype=np.float64) * time.dt
    curve = curve_of(file.curve)
    parts = []
    for row in wanted.tolist():
        far = movement.distance(path[int(links.src[row])], path[int(links.dst[row])], ticks)
        value = np.asarray(curve(far))
        changes = np.append(True, value[1:] != value[:-1])
        parts.append(Measured(ticks[changes], np.full(int(changes.sum()), row), value[changes]))
    return Measured(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _down_at_first(given: Measured, rows: Mask) -> Measured:
    """Links of which nothing is said at first are down."""
    told = np.zeros(len(rows), dtype=bool)
    told[given.link[given.time == 0.0]] = True
    missing = np.flatnonzero(rows & ~told)
    nothing = np.zeros(len(missing))
    return Measured(
        np.concatenate([nothing, given.time]),
        np.concatenate([missing, given.link]),
        np.concatenate([nothing, given.value]),
    )


def _again_and_again(given: Measured, period: float, time: TimeSection) -> Measured:
    if not np.diff(given.time).any():
        return given  # one value, over and over
    times = int(np.ceil(time.duration / period)) + 1
    if (rows := times * len(given.time)) > _MOST_ROWS:
        raise MeasuredError(
            f"{period:g} s again and again in {time.duration:g} s are {rows} values on all links, at most {_MOST_ROWS}: "
            "give a shorter run, or it to fewer links"
        )
    turns = np.repeat(np.arange(times), len(given.time)) * period
    return Measured(np.tile(given.time, times) + turns, np.tile(given.link, times), np.tile(given.value, times))


def _at_its_end(given: Measured, rows: Mask, time: TimeSection) -> list[str]:
    moments: Array = given.time[rows[given.link]]
    notes = []
    if len(moments) and (last := float(moments.max())) < time.duration - time.dt:
        notes.append(f"its last row is of {last:g} s, and each value holds to the end of the run ({time.duration:g} s)")
    if given.splits_ticks(time.dt, time.ticks):
        notes.append(f"it changes within ticks of {time.dt:g} s: each tick has its mean over time")
    return notes
