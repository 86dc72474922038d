"""Accuracy of the chains: mean loss, bursts, age and extra delay, as `netem.impairments.chain` gives them in closed form."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import flown
import numpy as np
from against import Against, Row

from analysis.models.arrays import Array, Integers, Mask
from netem.faults.fault import Fault, Verb
from netem.impairments.chain import Chain, all_together
from netem.impairments.loss import bernoulli, bursts, gilbert_elliott, markov
from netem.medium.verdict import Verdict

# Bursts longer than one message, or there is nothing to compare; and the share that is cut short.
_ENOUGH, _HARDLY = 25, 0.002


class Case(NamedTuple):
    """Chains that act on every link."""

    model: str
    parameters: str
    chains: tuple[Chain, ...]
    by_packet: bool = False


_NETEM = gilbert_elliott(0.01, 0.10, 0.70, 0.001)
_BUSY = gilbert_elliott(0.0294, 0.25, 0.95, 0.0, extra_delay=0.03)
_STATES = markov(0.05, 0.30, 0.20, 0.40, 0.01)

CASES = (
    Case("Bernoulli", "0.2", (bernoulli(0.2),)),
    Case("Bernoulli", "0.001", (bernoulli(0.001),)),
    Case("Gilbert", "p 0.02, r 0.25", (gilbert_elliott(0.02, 0.25),)),
    Case("Gilbert", "p 0.02, r 0.02", (gilbert_elliott(0.02, 0.02),)),
    Case("Gilbert-Elliott", "1% 10% 70% 0.1%", (_NETEM,)),
    Case("Gilbert-Elliott", "p 0.0294, r 0.25, bad 0.95, 30 ms", (_BUSY,)),
    Case("Markov, 4 states", "0.05 0.30 0.20 0.40 0.01", (_STATES,)),
    Case("bursts", "0.1 in 1, 2, 3: 0.5 0.2 0.3", (bursts(0.1, [0.5, 0.2, 0.3]),)),
    Case("two layers", "0.05; Gilbert 0.02, 0.25", (bernoulli(0.05), gilbert_elliott(0.02, 0.25))),
    Case("Gilbert by packet", "p 0.02, r 0.25", (gilbert_elliott(0.02, 0.25),), by_packet=True),
    Case("netem gemodel", "by packet: 1% 10% 70% 0.1%", (_NETEM,), by_packet=True),
    Case("netem state", "by packet: 5% 30% 20% 40% 1%", (_STATES,), by_packet=True),
    Case("two layers by packet", "gemodel; 0.05 0.03 40 ms", (_NETEM, gilbert_elliott(0.05, 0.3, 0.5, 0, 0.04)), True),
)


def check(verdicts: int, seed: int) -> Iterator[Row]:
    """Every chain, and scripted loss."""
    for number, case in enumerate(CASES):
        yield from _chain(case, verdicts, seed + number)
    yield from _scripted(verdicts, seed + len(CASES))


def _chain(case: Case, verdicts: int, seed: int) -> Iterator[Row]:
    chain, against = all_together(case.chains), Against(case.model, case.parameters)
    lost, delayed_s = _by_message(case, verdicts, seed)
    if len(chain.loss) == 1:
        yield against.share("mean loss", chain.mean_loss, lost)
    else:
        yield against.mean("mean loss", chain.mean_loss, lost.mean(axis=0))
        yield from _stationary(against, case, verdicts, seed + 500)
    yield from burst_rows(against, chain, lost)
    warm = len(lost) // 4
    yield against.mean("mean age", chain.mean_age, _age(lost)[warm:].mean(axis=0))
    if chain.extra_delay.any():
        above, below = np.where(lost, 0.0, delayed_s).sum(axis=0), (~lost).sum(axis=0)
        yield against.ratio("mean extra delay, s", chain.mean_extra_delay, above, below)


def _by_message(case: Case, verdicts: int, seed: int) -> tuple[Mask, Array]:
    """Losses and delays of the messages of every link, one after the other, (M, L); a chain by packet is offered half."""
    links, ticks = flown.size(verdicts)
    air = flown.medium(seed, links, chains=flown.layers(links, *case.chains, by_packet=case.by_packet))
    if not case.by_packet:
        made = flown.fly(air, ticks)
        return made.kind[:, 0] == Verdict.LOST, (made.due[:, 0] - np.arange(float(ticks))[:, None]) * flown.DT
    ticks = 2 * ticks + 400
    offered = np.random.default_rng(seed).random((ticks, 1, len(links))) < 0.5
    made = flown.fly(air, ticks, offered)
    few = int(offered.sum(axis=0).min())
    when = np.argsort(~offered[:, 0], axis=0, kind="stable")[:few]
    lost = np.take_along_axis(made.kind[:, 0], when, axis=0) == Verdict.LOST
    waited = np.take_along_axis(made.due[:, 0], when, axis=0) - when
    return lost, np.asarray(waited * flown.DT, dtype=np.float64)


def _stationary(against: Against, case: Case, verdicts: int, seed: int) -> Iterator[Row]:
    links = flown.pairs(max(100, verdicts // 64))
    air = flown.medium(seed, links, chains=flown.layers(links, *case.chains, by_packet=case.by_packet))
    lost = flown.fly(air, 64).kind[:, 0] == Verdict.LOST
    chain = all_together(case.chains)
    yield against.share("loss of the first message", chain.mean_loss, lost[0])
    yield against.share("loss of the 64th", chain.mean_loss, lost[63])


def burst_rows(against: Against, chain: Chain, lost: Mask) -> Iterator[Row]:
    """Of the bursts that begin early enough to be seen whole."""
    horizon = len(lost) // 3
    begins = ~lost[:-1] & lost[1:]
    begins[len(lost) - 1 - horizon :] = False
    tick, link = np.nonzero(begins)
    length = np.minimum(_next_pass(lost)[tick + 1, link] - tick - 1, horizon)
    counted = np.zeros((lost.shape[1], horizon))
    np.add.at(counted, (link, length - 1), 1.0)
    chances = chain.burst_lengths(horizon - 1)
    if counted.sum() * (1.0 - chances[0]) < _ENOUGH:
        return
    if _renews(chain):
        yield against.counts("burst lengths", chances, counted.sum(axis=0))
    else:
        yield against.counts_by_link("burst lengths", chances, counted)
    if 1.0 - chances.sum() < _HARDLY:
        yield against.ratio("mean burst", chain.mean_burst, counted @ np.arange(1.0, horizon + 1), counted.sum(axis=1))


def _renews(chain: Chain) -> bool:
    """Whether a burst knows nothing of the one before: it ends in the one state there is to pass in."""
    return len(chain.loss) == 1 or (set(chain.loss.tolist()) == {0.0, 1.0} and (chain.loss == 0.0).sum() == 1)


def _next_pass(lost: Mask) -> Integers:
    """When the next message passes, of every (tick, link)."""
    when = np.where(lost, len(lost), np.arange(len(lost))[:, None])
    return np.minimum.accumulate(when[::-1], axis=0)[::-1]


def _age(lost: Mask) -> Integers:
    ticks = np.arange(len(lost))[:, None]
    return ticks - np.maximum.accumulate(np.where(lost, -1, ticks), axis=0)


def _scripted(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    everywhere = tuple(links.index)
    faults = [Fault(Verb.LOSE, 0, None, pairs=everywhere, probability=loss) for loss in (0.1, 0.3)]
    kind = flown.fly(flown.medium(seed, links, faults=faults), ticks).kind
    against = Against("scripted loss", "0.1 and 0.3 at once")
    yield against.share("mean loss", 1.0 - 0.9 * 0.7, kind == Verdict.SCRIPTED)
    heard = flown.fly(flown.medium(seed, links, ("sense", "input", "theta"), faults=faults), 50).kind
    yield against.exactly("channels of one verdict", 1.0, float((heard == heard[:, :1]).all(axis=1).mean()))
