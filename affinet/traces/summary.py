"""What link data come to, link by link: losses, how long they last, delays, rates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from affinet.traces import runs
from affinet.traces.link_data import INDIRECT, LinkData, Messages, Quantity, Steps
from analysis.models.arrays import Array, Mask


@dataclass(frozen=True)
class Outages:
    """How often nothing passes, and for how long, in messages in a row or in seconds."""

    number: int
    mean: float
    longest: float


@dataclass(frozen=True)
class LinkSummary:
    """What a link comes to; None where nothing is said of it.

    Parameters
    ----------
    link
        By the names of the file.
    loss
        In the mean over messages, or over time.
    outages
        Of messages in a row, or of time, in which nothing passes.
    delays_s
        The mean, the median and what 95 % do not exceed.
    rate
        In the mean over time, in bit/s.
    reordered, doubled
        Shares of messages that arrived.
    measured
        Of what says no availability by itself: least, mean and largest.
    """

    link: str
    loss: float | None = None
    outages: Outages | None = None
    delays_s: tuple[float, float, float] | None = None
    rate: float | None = None
    reordered: float | None = None
    doubled: float | None = None
    measured: tuple[float, float, float] | None = None


def summaries(data: LinkData) -> list[LinkSummary]:
    """Every link of the data, in the order of its names; of messages, their only one."""
    if data.messages is not None:
        return [_of_messages(f"{data.nodes[0]}->{data.nodes[1]}", data.messages)]
    return [_of_steps(data, src, dst) for src, dst in _pairs(data)]


def sequences(data: LinkData, step: float | None) -> list[Mask]:
    """What chains are fitted to: of each link whether messages were lost, or whether it was down, step by step.

    Of two ways that are always up and down together one counts: the other says nothing new.

    Parameters
    ----------
    data
        Which says either.
    step
        In seconds, of data over time; of messages, each is one.

    Raises
    ------
    ValueError
        When it does not say what was lost, or there is no step.
    """
    if data.messages is not None:
        return [data.messages.lost]
    if Quantity.AVAILABILITY not in data.steps:
        raise ValueError("it says nothing of losses: there is nothing to fit a chain to")
    availability = data.steps[Quantity.AVAILABILITY]
    if not np.isin(availability.value, (0.0, 1.0)).all():
        raise ValueError(
            "it says which share of messages passed, not which: how long bursts are cannot be known from it; "
            "leave out --fit, and the profile follows the file"
        )
    if step is None:
        raise ValueError("it says when links are up: give the step of the chain by --dt, in seconds")
    time: Array = np.arange(0.0, data.ends - step / 2.0, step)
    if len(time) < 2:
        raise ValueError(f"it ends at {data.ends:g} s: give a --dt that is much less")
    found: dict[tuple[int, int], Mask] = {}
    for src, dst in _pairs(data):
        down = _held_at(_of_link(availability, src, dst), time) == 0.0
        if (dst, src) not in found or (found[dst, src] != down).any():
            found[src, dst] = down
    return list(found.values())


def _pairs(data: LinkData) -> Sequence[tuple[int, int]]:
    told = {pair for one in data.steps.values() for pair in zip(one.src.tolist(), one.dst.tolist(), strict=True)}
    return sorted(told)


def _of_messages(link: str, said: Messages) -> LinkSummary:
    arrived = int((~said.lost).sum())
    bursts, _ = runs.lengths(said.lost[None])
    return LinkSummary(
        link,
        loss=float(said.lost.mean()),
        outages=_outages(bursts.astype(np.float64)),
        delays_s=_delays(said.delay[~said.lost]),
        reordered=float(said.late.sum() / arrived),
        doubled=said.doubled / arrived,
    )


def _of_steps(data: LinkData, src: int, dst: int) -> LinkSummary:
    own = {what: _of_link(one, src, dst) for what, one in data.steps.items()}
    own = {what: one for what, one in own.items() if len(one.time)}
    loss = outages = delays = rate = measured = None
    if (worth := own.get(Quantity.AVAILABILITY)) is not None:
        loss, outages = 1.0 - _mean(worth, data.ends), _outages(_down(worth, data.ends))
    if (late := own.get(Quantity.DELAY)) is not None:
        delays = _delays(late.value)
    if (passing := own.get(Quantity.RATE)) is not None:
        rate = _mean(passing, data.ends)
    for what in INDIRECT:
        if what in own:
            value = own[what].value
            measured = (float(value.min()), _mean(own[what], data.ends), float(value.max()))
    return LinkSummary(f"{data.nodes[src]}->{data.nodes[dst]}", loss, outages, delays, rate, measured=measured)


def _of_link(given: Steps, src: int, dst: int) -> Steps:
    own = given.at((given.src == src) & (given.dst == dst))
    return own.at(np.argsort(own.time, kind="stable"))


def _lasts(given: Steps, ends: float) -> Array:
    return np.diff(np.append(given.time, max(ends, float(given.time[-1]))))


def _mean(given: Steps, ends: float) -> float:
    """Over time, of what holds until the next; at one moment only, what holds there."""
    lasts = _lasts(given, ends)
    return float((lasts * given.value).sum() / lasts.sum()) if lasts.sum() > 0.0 else float(given.value[-1])


def _down(given: Steps, ends: float) -> Array:
    return np.array(list(_spells(given.value == 0.0, _lasts(given, ends))))


def _spells(held: Mask, lasts: Array) -> Iterator[float]:
    spell = 0.0
    for one, seconds in zip([*held.tolist(), False], [*lasts.tolist(), 0.0], strict=True):
        if one:
            spell += seconds
        elif spell:
            yield spell
            spell = 0.0


def _outages(lengths: Array) -> Outages:
    return Outages(len(lengths), float(lengths.mean()), float(lengths.max())) if len(lengths) else Outages(0, 0.0, 0.0)


def _delays(seconds: Array) -> tuple[float, float, float]:
    return float(seconds.mean()), float(np.median(seconds)), float(np.quantile(seconds, 0.95))


def _held_at(given: Steps, time: Array) -> Array:
    place = np.searchsorted(given.time, time + 1e-9, side="right") - 1
    return np.where(place < 0, 0.0, given.value[np.maximum(place, 0)])
