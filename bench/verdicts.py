"""The cost of a tick's verdicts: `Medium.judge` and `Medium.deliver` with every layer on.

    python bench/verdicts.py [--ticks 2560] [--rounds 3] [--profile]

Four coupled channels, every message offered. On: two layers of chains, correlated normal delays, duplicates, corruption,
overtaking, log-distance reach with shadowing, a zone, a schedule, a listed message, limited rate, and a timeline with a cut, a
partition and scripted loss. The median is that of a tick whose draws are at hand; the mean has the draws of 64 ticks in it.
Machines are noisy: the table has the best round of each, and `--profile` says where the time goes.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import statistics
import time

import flown
import numpy as np

from netem.core.links import Links
from netem.faults.fault import Fault, Verb
from netem.impairments import schedule
from netem.impairments.delay import DelayLaw as DelayLaw
from netem.impairments.delay import MessageDelay
from netem.impairments.jamming import Zone
from netem.impairments.loss import bernoulli, gilbert_elliott
from netem.impairments.rate import Rate
from netem.impairments.reach import Reach, ReachLaw
from netem.impairments.schedule import Schedule
from netem.medium.medium import Medium

_CHANNELS = ("sense", "measurement", "input", "theta")
_WARM = 128
# Agents, neighbours on each side, and the aim in microseconds.
_SWARMS = ((10, 3, 150.0), (100, 6, 1500.0))


def everything(links: Links, ticks: int) -> Medium:
    """The air with all its layers on."""
    size, all_ = len(links), np.ones(len(links), dtype=bool)
    pairs, half = tuple(links.index), links.agents // 2
    groups = (tuple(range(1, half + 1)), tuple(range(half + 1, links.agents + 1)))
    third = _WARM + ticks // 3
    return flown.medium(
        1,
        links,
        _CHANNELS,
        faults=(
            Fault(Verb.CUT, third, 2 * third, pairs=pairs[:4]),
            Fault(Verb.PARTITION, 2 * third, None, groups=groups),
            Fault(Verb.LOSE, 0, None, pairs=pairs, probability=0.02),
        ),
        chains=flown.layers(links, bernoulli(0.1), gilbert_elliott(0.02, 0.25, 0.95, 0.01, 0.03)),
        delays=(MessageDelay(DelayLaw.NORMAL, all_, 0.015, 0.006, np.empty(0), 0.5, False),),
        duplicate=np.full(size, 0.02),
        corrupt=np.tile([0.005, 0.005, 0.005, 0.005], (size, 1)),
        bias=np.ones(size),
        reorder=np.full(size, 0.05),
        reaches=(Reach(ReachLaw.LOG_DISTANCE, all_, 0.0, 40.0, 3.0, 4.0, 10, True, True),),
        zones=(Zone(np.array([1.0, 0.0]) * links.agents, links.agents / 3.0, 0.5, all_, True, True),),
        schedules=(Schedule(*schedule.slotted(links, 1)[:2], np.full(size, links.agents - 2), True, True),),
        listed=np.array([[0, 1000, 1, 1]]),
        rate=Rate(np.full(size, 1.2e5), np.full(size, 1e3), np.full(size, 2e3)),
    )


def judged(links: Links, ticks: int) -> list[float]:
    """Seconds of every tick, warm."""
    air, offered = everything(links, ticks), np.ones((len(_CHANNELS), len(links)), dtype=bool)
    angle = 2.0 * np.pi * np.arange(links.agents) / links.agents
    position = links.agents * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    state, times = air.begin(), []
    for tick in range(_WARM + ticks):
        began = time.perf_counter()
        state, verdicts = air.judge(state, tick, offered, position)
        state, _ = air.deliver(state, tick, verdicts)
        times.append(time.perf_counter() - began)
    return times[_WARM:]


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=2560)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--profile", action="store_true", help="where the time goes")
    options = parser.parse_args()
    swarms = [(flown.ring(agents, reach), aim) for agents, reach, aim in _SWARMS]
    print("| links | channels | median, us | mean, us | mean of the rounds | aim, us |")
    print("|---|---|---|---|---|---|")
    for links, aim in swarms:
        rounds = [judged(links, options.ticks) for _ in range(options.rounds)]
        medians, means = ([1e6 * kind(times) for times in rounds] for kind in (statistics.median, statistics.fmean))
        spread = f"{min(means):.0f} to {max(means):.0f}"
        print(
            f"| {len(links)} of {links.agents} agents | {len(_CHANNELS)} | {min(medians):.0f} | {min(means):.0f} | {spread} "
            f"| {aim:g} |",
            flush=True,
        )
    if options.profile:
        for links, _ in swarms:
            with cProfile.Profile() as profile:
                judged(links, options.ticks)
            pstats.Stats(profile).sort_stats("tottime").print_stats(25)
            pstats.Stats(profile).sort_stats("cumulative").print_stats(40)


if __name__ == "__main__":
    main()
