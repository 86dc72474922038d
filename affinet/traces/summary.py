"""What link data come to, link by link: losses, how long they last, delays, rates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from affinet.traces import runs
from affinet.traces.link_data import INDIRECT, LinkData, Messages, Quantity, Steps
from analysis.models.arrays import Array, Mask

MOST_STEPS = 1_000_000  # of messages or of time, on all links, to which a chain is fitted


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
    by_link = {what: _by_link(one) for what, one in data.steps.items()}
    pairs = sorted({pair for links in by_link.values() for pair in links})
    return [
        _of_steps(f"{data.nodes[pair[0]]}->{data.nodes[pair[1]]}", data.ends, own)
        for pair in pairs
        if (own := {what: links[pair] for what, links in by_link.items() if pair in links})
    ]


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
        When it does not say what was lost, there is no step, or there are too many.
    """
    if data.messages is not None:
        if (messages := len(data.messages.lost)) > MOST_STEPS:
            raise ValueError(f"{messages} messages, and a chain is fitted to at most {MOST_STEPS}: cut it into parts")
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
    links = _by_link(availability)
    if (count := data.ends / step * len(links)) > MOST_STEPS:
        raise ValueError(
            f"{count:.3g} steps of {step:g} s on {len(links)} links up to {data.ends:.10g} s, and a chain is fitted to at "
            f"most {MOST_STEPS}: give a larger --dt, or --begins where it does not begin at 0"
        )
    time: Array = np.arange(0.0, data.ends - step / 2.0, step)
    if len(time) < 2:
        raise ValueError(f"it ends at {data.ends:g} s: give a --dt that is much less")
    found: dict[tuple[int, int], Mask] = {}
    for (src, dst), own in links.items():
        down = _held_at(own, time) == 0.0
        if (dst, src) not in found or (found[dst, src] != down).any():
            found[src, dst] = down
    return list(found.values())


def _by_link(given: Steps) -> Mapping[tuple[int, int], Steps]:
    """The steps of each link, in the order of time; sorted once, as there may be many links."""
    order = np.lexsort((given.time, given.dst, given.src))
    held = given.at(order)
    turns = np.flatnonzero((np.diff(held.src) != 0) | (np.diff(held.dst) != 0)) + 1
    edges = [0, *turns.tolist(), len(order)]
    return {
        (int(held.src[begin]), int(held.dst[begin])): held.at(np.arange(begin, end))
        for begin, end in pairwise(edges)
        if begin < end
    }


def _of_messages(link: str, said: Messages) -> LinkSummary:
    arrived = int((~said.lost).sum())
    bursts, _ = runs.lengths(said.lost[None])
    return LinkSummary(
        link,
        loss=float(said.lost.mean()),
        outages=_outages(bursts.astype(np.float64)),
        delays_s=_delays(said.delay[~said.lost]),
        reordered=float(said.late.sum() / arrived),
        doubled=float(said.doubled.sum() / arrived),
    )


def _of_steps(link: str, ends: float, own: Mapping[Quantity, Steps]) -> LinkSummary:
    loss = outages = delays = rate = measured = None
    if (worth := own.get(Quantity.AVAILABILITY)) is not None:
        loss, outages = 1.0 - _mean(worth, ends), _outages(_down(worth, ends))
    if (late := own.get(Quantity.DELAY)) is not None:
        delays = _delays(late.value)
    if (passing := own.get(Quantity.RATE)) is not None:
        rate = _mean(passing, ends)
    for what in INDIRECT:
        if what in own:
            value = own[what].value
            measured = (float(value.min()), _mean(own[what], ends), float(value.max()))
    return LinkSummary(link, loss, outages, delays, rate, measured=measured)


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
