"""What the air of a scenario comes to, in closed form, for people."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from affinet.planning.link_classes import SCHEDULES, LinkClass
from affinet.scenario import profiles, reaches, trace_files
from analysis.models.finding import Finding
from netem.core.links import Links
from netem.impairments import delay, schedule
from netem.impairments.chain import all_together

_LARGEST_CHAIN = 512


def echo(one: LinkClass, links: Links, dt: float, least_delay: int) -> Finding:
    """What a class of links comes to, in closed form."""
    parts = [chain for chain, _ in one.chains]
    open_share = 1.0
    if one.losses(SCHEDULES):
        turns = one.schedule(links)
        periods = {
            (int(period), int(lasts))
            for period, lasts in zip(turns.period[one.rows], turns.lasts[one.rows], strict=True)
        }
        open_share = float((turns.lasts / turns.period)[one.rows].mean())
        if len(periods) == 1 and max(periods)[0] <= _LARGEST_CHAIN:
            parts.append(schedule.turning(*periods.pop()))
            open_share = 1.0
    passing = open_share * float(np.prod([1.0 - part.mean_loss for part in parts]))
    simple = open_share == 1.0 and np.prod([len(part.loss) for part in parts]) <= _LARGEST_CHAIN
    whole = all_together(parts) if simple else None
    words = [f"mean loss {1.0 - passing:.4g}"]
    if whole is not None and passing < 1.0:
        words.append(f"mean burst {whole.mean_burst:.3g} ticks")
    if one.comms:
        seconds, ticks = _mean_delay(one, dt, least_delay)
        extra = sum(part.mean_extra_delay for part in parts)
        words.append(f"mean delay {seconds + extra:.4g} s ({ticks + extra / dt:.3g} ticks)")
        if whole is not None:
            words.append(f"age of information {(whole.mean_age + ticks + extra / dt) * dt:.3g} s")
    words += [_SAYS[type(model)](model) for model in one.profile.loss or [] if type(model) in _SAYS]
    return Finding("air", "ok", f"{one.title}: {', '.join(words)}")


def _mean_delay(one: LinkClass, dt: float, least_delay: int) -> tuple[float, float]:
    """Mean delay in seconds, in closed form, and in ticks, by the quantile function."""
    laws = one.delays(dt)
    share = (np.arange(4096) + 0.5) / 4096
    seconds = sum((law.quantile(share) for law in laws), start=np.zeros(len(share)))
    ticks = delay.ticks(seconds, dt, least_delay)
    return sum(law.mean_delay for law in laws), float(ticks.mean())


_SAYS: Mapping[type[Any], Callable[[Any], str]] = {
    profiles.Own: lambda model: f"and what {model.model} loses",
    profiles.Listed: lambda model: f"drops messages {model.messages[:6]}{' ...' if len(model.messages) > 6 else ''}",
    trace_files.Traced: lambda model: f"and what the trace {model.file} says",
    reaches.Disk: lambda model: f"nothing beyond {model.range:g} m",
    reaches.Ramp: lambda model: f"all within {model.inner:g} m, nothing beyond {model.outer:g} m",
    reaches.LogDistance: lambda model: f"half of the rest at {model.range:g} m",
    profiles.RoundRobin: lambda _: "each agent hears one neighbour at a time",
    profiles.Slotted: lambda _: "each agent speaks in its own slot",
}
