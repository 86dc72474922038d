"""Network section -> the air: what impairs each link."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from affinet.planning import limits, own_losses, recordings, traces
from affinet.planning.echo import echo
from affinet.planning.link_classes import REACHES, SCHEDULES, LinkClass, classes, select
from affinet.scenario import profiles, reaches, trace_files
from affinet.scenario.air import NetworkSection
from affinet.scenario.profiles import LinkProfile
from affinet.scenario.sections import Scenario, TimeSection
from affinet.scenario.trace_files import TraceFile
from affinet.scenario.wrong import ScenarioError
from affinet.traces.link_data import Quantity
from agents.exchange import Channels
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.finding import Finding
from netem.core import channels
from netem.core.links import Links
from netem.impairments import reach, trace
from netem.impairments.chain import ChainLayer, steady
from netem.impairments.corrupt import Mark
from netem.impairments.delay import DelayLaw, MessageDelay
from netem.impairments.jamming import Zone
from netem.impairments.profile import Profile
from netem.impairments.rate import Rate
from netem.impairments.rate_over_time import RateOverTime
from netem.impairments.reach import Reach
from netem.impairments.trace import DelayTrace, Trace
from world.formation.nominal import Formation

_Held = tuple[Integers, Array]  # when it changes, and what it is, by link
_ByClass = Mapping[int, tuple[_Held, list[Finding]]]

_ENVELOPE_BYTES, _NUMBER_BYTES, _TRUTH_BYTES = 32, 8, 1


def plan(
    given: Scenario, formation: Formation, links: Links, message_bits: Array, ruled: Mask | None = None
) -> tuple[Profile, tuple[Finding, ...]]:
    """The air of a scenario, and what is to be said of it.

    Parameters
    ----------
    given, formation, links
        The scenario, who flies, and over which links.
    message_bits
        Size of a message on each channel, shape (C,).
    ruled
        The links that ever meet it, shape (L,), if not all.

    Raises
    ------
    ScenarioError
        When a profile is not there, cannot ever deliver, or selects nothing.
    """
    network, dt = given.network, given.time.dt
    groups = classes(network, formation, links)
    heard = [one for one in groups if one.comms]
    limits.delays(heard, message_bits, given.time)
    traced = [
        _trace(one, links, one.rows if ruled is None else one.rows & ruled, given.time)
        for one in groups
        if one.losses(trace_files.Traced)
    ]
    slowed = _over_time(heard, Quantity.DELAY, links, ruled, given.time)
    limited = _over_time(heard, Quantity.RATE, links, ruled, given.time)
    rate = _rate(heard, links, message_bits)
    profile = Profile(
        dt=dt,
        coupled=network.coupled,
        least_delay=1 if given.time.exchange == "next-tick" else 0,
        chains=tuple(layer for group in _by_channels(groups) for layer in _chain_layers(group, links)),
        traces=tuple(held for held, _ in traced),
        schedules=tuple(one.schedule(links) for one in groups if one.losses(SCHEDULES)),
        reaches=tuple(_reach(one, dt) for one in groups if one.losses(REACHES)),
        zones=_zones(network, formation, links),
        own=tuple(loss for one in groups for loss in own_losses.of_class(one, given.own_modules)),
        listed=_listed(groups),
        delays=tuple(law for one in heard for law in _laws(one, dt)),
        delay_traces=tuple(DelayTrace(*held) for held, _ in slowed.values()),
        duplicate=_each(heard, links, lambda profile: profile.duplicate or 0.0),
        reorder=_each(heard, links, lambda profile: profile.reorder or 0.0),
        corrupt=np.stack([_each(heard, links, partial(_chance, kind)) for kind in list(Mark)[1:]], axis=-1),
        bias=_each(heard, links, _bias),
        rate=None if limited else rate,
        rate_trace=_rate_over_time(heard, rate, limited, dt) if rate and limited else None,
        message_bits=message_bits,
    )
    own_losses.try_out(profile.own, links, dt, formation.nominal, coupled=network.coupled)
    notes = [Finding("air", "note", f"{name}: {note}") for name, own in network.profiles.items() for note in own.notes]
    notes += [note for _, said in (*traced, *slowed.values(), *limited.values()) for note in said]
    return profile, (*(echo(one, links, dt, profile.least_delay) for one in groups), *notes)


def degraded(
    given: Scenario, formation: Formation, links: Links, message_bits: Array, name: str, key: str, ruled: Mask
) -> tuple[Profile, list[Finding]]:
    """The air of links that have the profile of this name in place of their own, and the notes on it.

    Parameters
    ----------
    given, formation, links, message_bits
        As of `plan`.
    name, key
        Of the profile, and the key that names it.
    ruled
        The links that ever have it, shape (L,).

    Raises
    ------
    ScenarioError
        As `plan` does.
    """
    network = given.network.model_copy(update={"profile": name, "links": []})
    try:
        air, said = plan(given.model_copy(update={"network": network}), formation, links, message_bits, ruled)
    except ScenarioError as error:
        raise ScenarioError(f"{key}: {error}") from error
    return air, [finding for finding in said if finding.check == "trace"]


def message_bits(names: Sequence[str], spoken: Channels, links: Links, dimension: int) -> Array:
    """Size of a message on each channel: its envelope, 8 bytes a number and 1 a truth; what a rate limit counts."""

    def payload(name: str) -> int:
        if name == channels.MEASUREMENT:
            return int(links.degree.max(initial=0)) * dimension * _NUMBER_BYTES
        sizes = [
            int(np.prod(field.shape)) * (_TRUTH_BYTES if field.dtype is bool else _NUMBER_BYTES)
            for field in spoken.get(name, {}).values()
        ]
        return sum(sizes)

    return np.array([8.0 * (_ENVELOPE_BYTES + payload(name)) for name in names])


def _by_channels(classes: Iterable[LinkClass]) -> list[list[LinkClass]]:
    grouped: dict[tuple[bool, bool], list[LinkClass]] = {}
    for one in classes:
        grouped.setdefault((one.sensing, one.comms), []).append(one)
    return list(grouped.values())


def _chain_layers(classes: Sequence[LinkClass], links: Links) -> list[ChainLayer]:
    layers, never = [], steady()
    depth = max(len(one.chains) for one in classes)
    for lane in range(depth):
        chosen, by_packet = [never] * len(links), np.zeros(len(links), dtype=bool)
        for one in classes:
            if lane < len(one.chains):
                chain, by_packet_here = one.chains[lane]
                for row in np.flatnonzero(one.rows):
                    chosen[row] = chain
                by_packet[one.rows] = by_packet_here
        if any(chain.loss.any() or chain.extra_delay.any() for chain in chosen):
            first = classes[0]
            layers.append(ChainLayer.of(lane, chosen, by_packet, sensing=first.sensing, comms=first.comms))
    return layers


def _trace(one: LinkClass, links: Links, rows: Mask, time: TimeSection) -> tuple[Trace, list[Finding]]:
    model = one.losses(trace_files.Traced)
    held, said = _followed(one, "", model, Quantity.AVAILABILITY, links, rows, time)
    return Trace(*held, one.sensing, one.comms), said


def _over_time(
    heard: Iterable[LinkClass], what: Quantity, links: Links, ruled: Mask | None, time: TimeSection
) -> _ByClass:
    """Delays or rates of the classes that follow a file in them, by the place of the class."""
    found = {}
    for place, one in enumerate(heard):
        said = one.profile.delay if what is Quantity.DELAY else one.profile.rate
        if said is not None and said.trace is not None:
            rows = one.rows if ruled is None else one.rows & ruled
            found[place] = _followed(one, f".{what}", said.trace, what, links, rows, time)
    return found


def _followed(
    one: LinkClass, key: str, file: TraceFile, what: Quantity, links: Links, rows: Mask, time: TimeSection
) -> tuple[_Held, list[Finding]]:
    path = Path(file.file)
    otherwise = {Quantity.DELAY: 0.0, Quantity.RATE: np.inf}.get(what, 1.0)
    try:
        if path.is_dir() and what is Quantity.AVAILABILITY:
            measured, notes = recordings.trace(path, links, rows, time, sensing=one.sensing)
        else:
            measured, notes = traces.measured(file, what, links, rows, time)
        held = trace.table(measured, links, rows, time.dt, time.ticks, what, otherwise)
    except FileNotFoundError as error:
        raise ScenarioError(f"network.profiles.{one.name}{key}: trace {path}: no such file") from error
    except (OSError, ValueError) as error:
        raise ScenarioError(f"network.profiles.{one.name}{key}: trace {path}: {error}") from error
    return held, [Finding("trace", "note", f"profile {one.name!r}: {path.name}: {note}") for note in notes]


def _laws(one: LinkClass, dt: float) -> list[MessageDelay]:
    """What its messages wait; of a trace only whether they keep their order, as time says the rest."""
    laws = one.delays(dt)
    if one.profile.delay is None or one.profile.delay.trace is None:
        return laws
    return [*laws[:-1], replace(laws[-1], law=DelayLaw.CONSTANT)]


def _reach(one: LinkClass, dt: float) -> Reach:
    model = one.losses(REACHES)
    match model:
        case reaches.Disk():
            shape = (reach.ReachLaw.RAMP, one.rows, model.range, model.range, 0.0, 0.0, 1)
        case reaches.Ramp():
            shape = (reach.ReachLaw.RAMP, one.rows, model.inner, model.outer, 0.0, 0.0, 1)
        case _:
            spell = max(1, round(model.coherence / dt))
            shape = (reach.ReachLaw.LOG_DISTANCE, one.rows, 0.0, model.range, model.exponent, model.shadowing, spell)
    return Reach(*shape, one.sensing, one.comms)


def _zones(network: NetworkSection, formation: Formation, links: Links) -> tuple[Zone, ...]:
    zones = []
    for number, zone in enumerate(network.zones, start=1):
        key = f"network.zones.{number}"
        if len(zone.centre) != formation.dimension:
            raise ScenarioError(f"{key}.centre: needs {formation.dimension} coordinates, in metres")
        if network.coupled and zone.channels:
            raise ScenarioError(f"{key}.channels: coupled = true gives sensing and comms one verdict")
        rows = np.zeros(len(links), dtype=bool)
        rows[select(zone.links, formation, links, f"{key}.links")] = True
        sensing, comms = zone.channels != "comms", zone.channels != "sensing"
        zones.append(Zone(np.array(zone.centre), zone.radius, zone.share, rows, sensing, comms))
    return tuple(zones)


def _listed(groups: Iterable[LinkClass]) -> Integers:
    rows = [
        (row, number, one.sensing, one.comms)
        for one in groups
        if (model := one.losses(profiles.Listed))
        for row in np.flatnonzero(one.rows).tolist()
        for number in model.messages
    ]
    return np.array(sorted(set(rows)), dtype=np.int64).reshape(-1, 4)


def _each(classes: Iterable[LinkClass], links: Links, value: Callable[[LinkProfile], float]) -> Array:
    figures = np.zeros(len(links))
    for one in classes:
        figures[one.rows] = value(one.profile)
    return figures


def _chance(kind: Mark, profile: LinkProfile) -> float:
    return sum(corruption.p for corruption in profile.corrupt or [] if corruption.kind == kind.label)


def _bias(profile: LinkProfile) -> float:
    return sum(corruption.by or 0.0 for corruption in profile.corrupt or [])


def _rate(classes: Sequence[LinkClass], links: Links, message_bits: Array) -> Rate | None:
    largest = float(message_bits[1:].max())
    for one in classes:
        if (limit := one.profile.rate) and 8 * (limit.queue + limit.burst) < largest:
            raise ScenarioError(
                f"network.profiles.{one.name}.rate: queue and burst hold {limit.queue + limit.burst} bytes, "
                f"and a message has up to {largest / 8:g}: some can never be delivered"
            )
    if not any(one.profile.rate for one in classes):
        return None

    def of(name: str, without: float) -> Array:
        figures = np.full(len(links), without)
        for one in classes:
            if one.profile.rate and (said := getattr(one.profile.rate, name)) is not None:
                figures[one.rows] = said
        return figures

    return Rate(of("rate", np.inf), 8.0 * of("burst", 0.0), 8.0 * of("queue", np.inf))


def _rate_over_time(classes: Sequence[LinkClass], rate: Rate, limited: _ByClass, dt: float) -> RateOverTime:
    """The limits of all links, of which those of some classes change over time."""
    ticks = np.unique(np.concatenate([changes for (changes, _), _ in limited.values()]))
    rates = np.tile(rate.rate, (len(ticks), 1))
    for place, ((changes, held), _) in limited.items():
        rates = np.where(classes[place].rows, held[np.searchsorted(changes, ticks, side="right") - 1], rates)
    return RateOverTime(dt, ticks, rates, rate.burst, rate.queue)
