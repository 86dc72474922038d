"""Profiles without impairments, profiles with every impairment, and a flight of the medium alone."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from netem.core.channels import SENSE
from netem.core.links import Links
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.impairments import reach
from netem.impairments.chain import Chain, ChainLayer
from netem.impairments.delay import DelayLaw, MessageDelay
from netem.impairments.jamming import Zone
from netem.impairments.loss import bernoulli
from netem.impairments.profile import Profile
from netem.impairments.rate import Rate
from netem.impairments.rate_over_time import RateOverTime
from netem.impairments.reach import Reach
from netem.impairments.schedule import Schedule
from netem.impairments.trace import DelayTrace, Trace
from netem.medium.in_flight import Delivery, MediumState, Verdicts
from netem.medium.medium import Medium

DT = 0.1
BITS = 100.0


def quiet_profile(links, channels, **changes):
    """A profile without impairments, with these changes."""
    size = len(links)
    quiet = Profile(
        dt=DT,
        coupled=True,
        least_delay=0,
        chains=(),
        traces=(),
        schedules=(),
        reaches=(),
        zones=(),
        own=(),
        listed=np.empty((0, 4), dtype=np.int64),
        delays=(),
        delay_traces=(),
        duplicate=np.zeros(size),
        reorder=np.zeros(size),
        corrupt=np.zeros((size, 4)),
        bias=np.zeros(size),
        rate=None,
        rate_trace=None,
        message_bits=np.full(len(channels), BITS),
    )
    return replace(quiet, **changes)


def losing(availability):
    """The layer of chains that lets pass each link's share of messages, shape (L,)."""
    chains = [bernoulli(1.0 - share) for share in availability]
    return ChainLayer.of(0, chains, np.zeros(len(chains), dtype=bool), sensing=True, comms=True)


def taking(ticks):
    """The delays under which messages take each link's number of ticks, shape (L,)."""
    ticks = np.asarray(ticks)
    return tuple(constant(DT * wait, ticks == wait) for wait in np.unique(ticks[ticks > 0]))


def constant(seconds, rows, *, ordered=False):
    """A delay that is always the same, on the links where `rows`."""
    return MessageDelay(DelayLaw.CONSTANT, rows, seconds, 0.0, np.empty(0), 0.0, ordered)


# ---- flights


class Flown(NamedTuple):
    """A tick of a flight."""

    verdicts: Verdicts
    delivery: Delivery
    air: MediumState


def everything(channels, links):
    """A message on every channel and link."""
    return np.ones((len(channels), len(links)), dtype=bool)


def fly(medium, offered, position=None):
    """Every tick's verdicts, what arrives, and the air after it, for offers (T, C, L) and positions (T, N, D)."""
    air, flown = medium.begin(), []
    for tick, offer in enumerate(offered):
        air, verdicts = medium.judge(air, tick, offer, None if position is None else position[tick])
        air, delivery = medium.deliver(air, tick, verdicts)
        flown.append(Flown(verdicts, delivery, air))
    return flown


def verdicts_of(seed, channels, profile, timeline, ticks):
    """What becomes of a message on every channel and link in every tick, shape (ticks, C, L)."""
    medium = Medium(seed, channels, [profile], timeline)
    flown = fly(
        medium, np.broadcast_to(everything(channels, timeline.links), (ticks, len(channels), len(timeline.links)))
    )
    return np.stack([tick.verdicts.kind for tick in flown])


# ---- mixtures

IMPAIRMENTS = (
    "chains",
    "chains of one class",
    "traces",
    "schedules",
    "reaches",
    "zones",
    "listed",
    "delays",
    "delay traces",
    "ordered",
    "duplicate",
    "reorder",
    "corrupt",
    "rate",
    "rate over time",
)


def mixture(mix, has, links, channels, *, coupled=True, least_delay=0):
    """A profile with the impairments named in `has`; those of a link depend on `mix` and its two ends alone."""
    whole = quiet_profile(links, channels, coupled=coupled, least_delay=least_delay)
    changes = {}
    if "chains" in has:
        changes["chains"] = tuple(_chains(mix, lane, links, sensing=True, comms=True) for lane in (0, 1))
    if "chains of one class" in has and not coupled:
        apart = [_chains(mix, lane, links, sensing=lane == 2, comms=lane == 3) for lane in (2, 3)]
        changes["chains"] = (*changes.get("chains", ()), *apart)
    if "traces" in has:
        changed = np.array([0, 7, 19])
        table = np.stack([each(mix, f"trace {tick}", links, lambda rng: rng.choice([1.0, 0.6])) for tick in changed])
        changes["traces"] = (Trace(changed, table, sensing=True, comms=True),)
    if "schedules" in has:
        period = each(mix, "period", links, lambda rng: rng.integers(1, 5))
        lasts = np.minimum(period, each(mix, "lasts", links, lambda rng: rng.integers(2, 5)))
        begins = each(mix, "begins", links, lambda rng: rng.integers(0, 4))
        changes["schedules"] = (Schedule(period, begins, lasts, sensing=True, comms=True),)
    if "reaches" in has:
        kind = each(mix, "reach", links, lambda rng: rng.integers(3))
        ramp = Reach(reach.ReachLaw.RAMP, kind == 1, 2.0, 8.0, 0.0, 0.0, 1, sensing=True, comms=True)
        shadow = Reach(reach.ReachLaw.LOG_DISTANCE, kind == 2, 0.0, 6.0, 3.0, 6.0, 3, sensing=True, comms=True)
        changes["reaches"] = (ramp, shadow)
    if "zones" in has:
        jammed = each(mix, "zone", links, lambda rng: rng.random() < 0.7)
        changes["zones"] = tuple(
            Zone(np.array(at), 4.0, 0.5, jammed, sensing=True, comms=True) for at in ([0.0, 0.0], [4.0, 4.0])
        )
    if "listed" in has:
        drops = [
            (row, n, 1, 1)
            for row, pair in enumerate(links.index)
            for n in rng_of(mix, "listed", pair).permutation(20)[:3]
        ]
        changes["listed"] = np.array(drops, dtype=np.int64).reshape(-1, 4)
    if "delays" in has:
        changes["delays"] = _delays(mix, links)
    if "delay traces" in has:
        changed = np.array([0, 5, 11])
        slower = np.stack([each(mix, f"slower {at}", links, lambda rng: DT * rng.integers(3)) for at in changed])
        changes["delay_traces"] = (DelayTrace(changed, slower),)
    if "ordered" in has:
        queued = MessageDelay(DelayLaw.UNIFORM, _on(mix, "ordered", links), 0.4, 0.4, np.empty(0), 0.0, ordered=True)
        changes["delays"] = (*changes.get("delays", ()), queued)
    for name in ("duplicate", "reorder"):
        if name in has:
            changes[name] = each(mix, name, links, lambda rng: rng.choice([0.0, 0.5]))
    if "corrupt" in has:
        changes["corrupt"] = each(mix, "corrupt", links, lambda rng: rng.dirichlet(np.ones(5))[1:] * rng.integers(2))
    if "rate" in has:
        rates = each(mix, "rate", links, lambda rng: rng.choice([np.inf, 1.2 * BITS / DT]))
        queue = np.where(np.isinf(rates), np.inf, 2 * BITS)
        changes["rate"] = Rate(rates, burst=np.full(len(links), BITS), queue=queue)
    if "rate over time" in has:
        changed = np.array([0, 4, 9])
        rates = np.stack([each(mix, f"rate {at}", links, lambda rng: BITS / DT * rng.integers(3)) for at in changed])
        burst, queue = np.full(len(links), BITS), np.full(len(links), 2 * BITS)
        changes["rate_trace"] = RateOverTime(DT, changed, rates, burst, queue)
    return replace(whole, **changes)


def each(mix, what, links, value):
    """A value for every link, by its own random numbers, shape (L, ...)."""
    return np.array([value(rng_of(mix, what, pair)) for pair in links.index])


def rng_of(mix, what, pair):
    """Random numbers of a link (src, dst), whatever other links there are."""
    return np.random.default_rng([mix, *what.encode(), *pair])


def roaming(mix, agents, ticks):
    """Positions (T, N, 2), in metres; those of an agent are its own, whatever other agents there are."""
    paths = [np.random.default_rng([mix, 0, agent]).uniform(-6.0, 6.0, size=(ticks, 2)) for agent in range(agents)]
    return np.stack(paths, axis=1)


def _on(mix, what, links):
    return each(mix, what, links, lambda rng: rng.random() < 0.5)


def _chains(mix, lane, links, *, sensing, comms):
    """Chains of one to four states."""
    by_packet = _on(mix, f"chain by packet {lane}", links)
    chains = [_chain(mix, lane, pair) for pair in links.index]
    return ChainLayer.of(lane, chains, by_packet, sensing=sensing, comms=comms)


@cache
def _chain(mix, lane, pair):
    rng = rng_of(mix, f"chain {lane}", pair)
    states = int(rng.integers(1, 5))
    loss, extra_delay = rng.choice([0.0, 0.1, 0.6], size=states), rng.choice([0.0, 0.15], size=states)
    return Chain(rng.dirichlet(np.ones(states), size=states), loss, extra_delay)


def _delays(mix, links):
    table = np.array([0.0, 0.05, 0.1, 0.4])
    laws = {
        DelayLaw.CONSTANT: (0.2, 0.0, 0.0),
        DelayLaw.UNIFORM: (0.2, 0.2, 0.3),
        DelayLaw.NORMAL: (0.1, 0.2, 0.9),
        DelayLaw.EXPONENTIAL: (0.1, 0.0, 0.0),
        DelayLaw.PARETO: (0.1, 0.1, 0.5),
        DelayLaw.TABLE: (0.0, 0.0, 0.0),
    }
    kind = each(mix, "delay", links, lambda rng: rng.integers(len(laws) + 1))
    return tuple(
        MessageDelay(law, kind == n, mean, jitter, table, correlation, ordered=False)
        for n, (law, (mean, jitter, correlation)) in enumerate(laws.items())
    )


# ---- strategies


def edges_of(agents):
    """Every edge there can be."""
    return [(i, j) for i in range(1, agents + 1) for j in range(i + 1, agents + 1)]


def faults_over(links, ticks):
    """A fault of any verb over these links, at any time of a run of so many ticks; degraded links have profile 1."""
    times = st.builds(_interval, st.integers(0, ticks - 1), st.none() | st.integers(1, 15))
    pairs = st.lists(st.sampled_from(list(links.index)), min_size=1, max_size=4).map(tuple)
    agents = st.integers(1, links.agents)
    sides = st.sets(agents, min_size=1, max_size=links.agents - 1)
    policies = st.sampled_from(UnderWay)
    return st.one_of(
        st.builds(lambda t, p, u: Fault(Verb.CUT, *t, pairs=p, under_way=u), times, pairs, policies),
        st.builds(
            lambda t, side, u: Fault(Verb.PARTITION, *t, groups=_halves(links.agents, side), under_way=u),
            times,
            sides,
            policies,
        ),
        st.builds(
            lambda t, p, loss: Fault(Verb.LOSE, *t, pairs=p, probability=loss), times, pairs, st.floats(0.0, 1.0)
        ),
        st.builds(
            lambda t, p, seconds: Fault(Verb.DELAY, *t, pairs=p, seconds=seconds), times, pairs, st.floats(0.0, 0.5)
        ),
        st.builds(lambda t, p: Fault(Verb.DEGRADE, *t, pairs=p, profile=1), times, pairs),
        st.builds(
            lambda t, p, miss: Fault(Verb.DROPOUT, *t, pairs=p, probability=miss), times, pairs, st.floats(0.0, 1.0)
        ),
        st.builds(lambda t, agent: Fault(Verb.KILL, *t, agents=(agent,)), times, agents),
        st.builds(
            lambda t, agent, body: Fault(Verb.DEPART, *t, agents=(agent,), body=body),
            times,
            agents,
            st.sampled_from(DepartedBody),
        ),
        st.builds(
            lambda t, agent, u: Fault(Verb.PAUSE, *t, agents=(agent,), under_way=u),
            times,
            agents,
            st.sampled_from([UnderWay.DROP, UnderWay.HOLD]),
        ),
        st.builds(
            lambda t, p, what: replace(what, start=t[0], end=t[1], pairs=p), times, pairs, st.sampled_from(OF_SENSORS)
        ),
        st.builds(
            lambda t, agent, what: replace(what, start=t[0], end=t[1], agents=(agent,)),
            times,
            agents,
            st.sampled_from(OF_AGENTS),
        ),
    )


# What is none of the medium's business: what sensors say of what they see, and what agents and their bodies do.
OF_SENSORS = (
    Fault(Verb.BIAS, 0, None, vector=(1.0, -0.5)),
    Fault(Verb.OUTLIER, 0, None, probability=0.5, deviation=3.0),
    Fault(Verb.FREEZE, 0, None),
)
OF_AGENTS = (
    Fault(Verb.CLOCK, 0, None, rate=-0.5),
    Fault(Verb.GUST, 0, None, vector=(1.0, -0.5)),
    Fault(Verb.LIE, 0, None, matrix=((0.0, 1.0), (-1.0, 0.0))),
)


def _interval(start, length):
    return start, None if length is None else start + length


def _halves(agents, side):
    return tuple(sorted(side)), tuple(agent for agent in range(1, agents + 1) if agent not in side)


class Case(NamedTuple):
    """A flight over any graph with any impairments and faults, in numbers that say how to fly it again."""

    seed: int
    agents: int
    edges: tuple[tuple[int, int], ...]
    mix: int
    has: frozenset[str]
    coupled: bool
    least_delay: int
    faults: tuple[Fault, ...]
    talk: float

    @property
    def links(self):
        return Links.both_ways(self.agents, self.edges)


@st.composite
def cases(draw, ticks, without=frozenset()):
    """Any case of so many ticks, without these impairments."""
    agents = draw(st.integers(2, 5))
    edges = draw(st.lists(st.sampled_from(edges_of(agents)), min_size=1, max_size=7, unique=True))
    faults = draw(st.lists(faults_over(Links.both_ways(agents, edges), ticks), max_size=5))
    return Case(
        seed=draw(st.integers(0, 2**64 - 1)),
        agents=agents,
        edges=tuple(edges),
        mix=draw(st.integers(0, 2**16)),
        has=draw(st.frozensets(st.sampled_from([name for name in IMPAIRMENTS if name not in without]))),
        coupled=draw(st.booleans()),
        least_delay=draw(st.sampled_from([0, 1])),
        faults=tuple(faults),
        talk=draw(st.sampled_from([0.2, 0.7, 1.0])),
    )


def fly_case(case, channels, ticks):
    """The timeline of a case, what is offered, and every tick."""
    links, timeline = case.links, Timeline(case.links, case.faults)
    profiles = [
        mixture(mix, case.has, links, channels, coupled=case.coupled, least_delay=case.least_delay)
        for mix in (case.mix, case.mix + 1)
    ]
    offered = chatter(case.mix, channels, links, ticks, case.talk)
    medium = Medium(case.seed, channels, profiles, timeline)
    return timeline, offered, fly(medium, offered, roaming(case.mix, case.agents, ticks))


def chatter(mix, channels, links, ticks, talk):
    """Offers (T, C, L): sensing always, as the world does; on every other channel and link a share `talk` of its own."""
    offered = np.ones((ticks, len(channels), len(links)), dtype=bool)
    for row, name in enumerate(channels):
        if name != SENSE:
            offered[:, row] = each(mix, name, links, lambda rng: rng.random(ticks) < talk).T
    return offered
