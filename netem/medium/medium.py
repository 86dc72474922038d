"""The medium: messages offered in a tick -> messages delivered in a tick, each with a verdict.

A loss is decided in `Medium.judge`, and nowhere else; `Ledger` counts it and `journal.py` writes it down. What the timeline
imposes is decided here, what a profile does in `link_model.py`; a message passes when neither holds it.

Nothing here knows what a message says: the medium works on who offered what, over (channels, links).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.channels import SENSE
from netem.core.draws import DrawnAhead, Purpose, Seed
from netem.core.links import Links
from netem.faults.conditions import Conditions
from netem.faults.timeline import Timeline
from netem.impairments.profile import Profile
from netem.medium.in_flight import Delivery, MediumState, Verdicts, Waits, deliver
from netem.medium.link_model import LinkModel, Memory
from netem.medium.verdict import Verdict, VerdictCodes, also_held, doom, standing

Of = TypeVar("Of", Verdicts, Waits)

JOURNAL = "journal.arrows"  # in a run directory

# Looking up the members of an enumeration costs as much as an operation on a small array.
_DELIVERED, _DELAYED, _PAUSED, _SCRIPTED, _DROPOUT = (
    np.uint8(kind) for kind in (Verdict.DELIVERED, Verdict.DELAYED, Verdict.PAUSED, Verdict.SCRIPTED, Verdict.DROPOUT)
)


class Verdicted(Protocol):
    """A source of verdicts that were decided before: `recorded.Recorded`."""

    def verdicts(self, tick: int, offered: Mask) -> Verdicts:
        """On the messages of a tick."""


def recorded(path: Path | None, links: Links, channels: Sequence[str]) -> Verdicted | None:
    """The verdicts in a journal, if there is one, for a run over these links and channels."""
    if path is None:
        return None
    from netem.medium import journal  # pyarrow takes a while to import, and only a replay reads journals
    from netem.medium.recorded import Recorded

    return Recorded(journal.read(path), links, channels)


class _Under(NamedTuple):
    """What conditions make of messages.

    Parameters
    ----------
    offered
        Where they are offered, shape (C, L).
    standing, doom
        Of those offered and those under way: a reason, or PASSED, shape (C, L) or (L,), and (L,).
    holds
        Where those under way wait, shape (L,).
    stalls
        Messages that pass, but wait for a paused receiver, shape (C, L), if any do.
    loses, drops_out, delays, degrades
        Whether some are lost by chance, not measured by chance, delayed, or ruled by another profile.
    """

    offered: Mask
    standing: VerdictCodes
    doom: VerdictCodes
    holds: Mask
    stalls: Mask | None
    loses: bool
    drops_out: bool
    delays: bool
    degrades: bool


class Medium:
    """What carries the messages of one run: its profiles, a timeline, and a seed.

    Parameters
    ----------
    seed
        Of the run, or of every agent's run.
    channels
        Names, sensing first; the rows of every (C, L) array.
    profiles
        What impairs the links: the first is their own, the others those to which faults degrade them.
    timeline
        What is scripted.
    recorded
        The verdicts of an earlier run, which then stand in place of all models.
    """

    def __init__(
        self,
        seed: Seed,
        channels: Sequence[str],
        profiles: Sequence[Profile],
        timeline: Timeline,
        recorded: Verdicted | None = None,
    ) -> None:
        self.timeline = timeline
        self._recorded = recorded
        self._links = timeline.links
        self._shape = (len(channels), len(self._links))
        self._sensing = np.array([name == SENSE for name in channels])[:, None]
        self._link_models = [LinkModel(seed, self._links, channels, profile) for profile in profiles]
        self._keeps_order = any(model.keeps_order for model in self._link_models)
        self._scripted = DrawnAhead(lambda ticks: self._link_models[0].draw(Purpose.SCRIPTED_LOSS, ticks))
        self._dropouts = DrawnAhead(lambda ticks: self._link_models[0].draw(Purpose.DROPOUT, ticks))
        self._conditions: Conditions | None = None
        self._cached: _Under

    def begin(self) -> MediumState:
        """The state before the first tick."""
        return MediumState.empty(self._shape, tuple(model.begin() for model in self._link_models))

    def offered(self, tick: int, measured: Array | None = None) -> Mask:
        """Where messages are offered in a tick, shape (C, L): who is awake speaks on all its links, and all sensors sense.

        Parameters
        ----------
        tick
            Its number.
        measured
            What sensors said, shape (L, D), NaN of those that said nothing; None where all said something.
        """
        offered = self._under(self.timeline.at(tick)).offered
        if measured is None:
            return offered
        return offered & (~np.isnan(measured).any(axis=-1) | ~self._sensing)

    def judge(
        self, state: MediumState, tick: int, offered: Mask, position: Array | None
    ) -> tuple[MediumState, Verdicts]:
        """The verdict on every message offered in a tick.

        Parameters
        ----------
        state
            As the tick before left it.
        tick
            Of the offer.
        offered
            True where a message was offered on (channel, link), shape (C, L).
        position
            The agents', shape (N, D), in metres; only a spatial profile needs them.
        """
        if self._recorded:
            return state._replace(offered=state.offered + offered), self._recorded.verdicts(tick, offered)
        now = self.timeline.at(tick)
        under = self._under(now)
        memories, verdicts, waits = self._by_profile(state, tick, offered, position, now, under)
        if under.stalls is not None:
            np.copyto(verdicts.kind, _DELAYED, where=under.stalls & (verdicts.kind == _DELIVERED))
        last_due = state.last_due
        if self._keeps_order:
            passed = (verdicts.kind == _DELIVERED) | (verdicts.kind == _DELAYED)
            last_due = np.where(passed, np.maximum(verdicts.due, verdicts.copy_due), last_due)
        return MediumState(state.under_way, state.offered + offered, offered, last_due, memories, waits), verdicts

    def deliver(self, state: MediumState, tick: int, verdicts: Verdicts) -> tuple[MediumState, Delivery]:
        """What arrives in this tick: the messages just passed, and those under way that are due."""
        under = self._under(self.timeline.at(tick))
        return deliver(state, tick, verdicts, under.doom, under.holds)

    def under(self, timeline: Timeline) -> Medium:
        """The same air under another timeline; both are cheap as long as they are asked for the same ticks in turn."""
        other = copy(self)
        other.timeline, other._conditions = timeline, None
        return other

    @property
    def ahead(self) -> bool:
        """Whether a tick can be judged before it is known where the agents are."""
        if self.timeline.pending or self._recorded:  # a journal ends with its run: nothing is known of the tick after
            return False
        return not any(model.profile.spatial for model in self._link_models)

    def bit_draws(self, content: Integers, channel: Integers, link: Integers) -> Array:
        """Which number and which bit of corrupted messages flip: uniform, shape (m, 2), for rows of messages (m,)."""
        return self._link_models[0].bit_draws(content, channel, link)

    def bias(self, content: Integers, link: Integers) -> Array:
        """What a bias adds to the numbers of messages that speak of ticks `content` (m,), on links (m,), shape (m,)."""
        ruling = [self.timeline.at(int(tick)).profile[row] for tick, row in zip(content, link, strict=True)]
        return np.array([self._link_models[n].profile.bias[row] for n, row in zip(ruling, link, strict=True)])

    def _by_profile(
        self, state: MediumState, tick: int, offered: Mask, position: Array | None, now: Conditions, under: _Under
    ) -> tuple[tuple[Memory, ...], Verdicts, Waits]:
        imposed, delay_s = self._imposed(tick, now, under), now.delay_s if under.delays else None
        own, *others = self._link_models
        if not under.degrades:
            memory, verdicts, waits = own.judge(state, state.memories[0], tick, offered, position, imposed, delay_s)
            rested = (model.rest(memory, tick) for model, memory in zip(others, state.memories[1:], strict=True))
            return (memory, *rested), verdicts, waits
        judged = [
            model.judge(state, memory, tick, offered & (now.profile == number), position, imposed, delay_s)
            for number, (model, memory) in enumerate(zip(self._link_models, state.memories, strict=True))
        ]
        _, whole, waits = judged[0]
        for number, (_, verdicts, of_these) in enumerate(judged[1:], start=1):
            ruled = now.profile == number
            whole, waits = _merged(ruled, verdicts, whole), _merged(ruled, of_these, waits)
        return tuple(memory for memory, _, _ in judged), whole, waits

    def _imposed(self, tick: int, now: Conditions, under: _Under) -> VerdictCodes:
        """What the timeline makes of messages: a reason, or PASSED, shape (C, L) or (L,)."""
        reason = under.standing
        if under.drops_out:
            reason = also_held(reason, self._sensing & (self._dropouts.at(tick) < now.dropout), _DROPOUT)
        if under.loses:
            reason = also_held(reason, self._scripted.at(tick) < now.loss, _SCRIPTED)
        return reason

    def _under(self, now: Conditions) -> _Under:
        """What these conditions mean for the links; they stay the same for many ticks."""
        if now is not self._conditions:
            self._conditions, self._cached = now, self._conditioned(now)
        return self._cached

    def _conditioned(self, now: Conditions) -> _Under:
        links, held = self._links, standing(self._links, now)
        deaf = now.paused[links.dst - 1]
        if deaf.any():  # a paused agent measures nothing; what is sent to it is dropped, or waits
            held = also_held(held, deaf & (self._sensing | now.pause_drops), _PAUSED)
        return _Under(
            offered=~now.idle[links.src - 1] | self._sensing,
            standing=held,
            doom=doom(links, now),
            holds=now.holds,
            stalls=deaf & ~self._sensing if deaf.any() else None,
            loses=bool(now.loss.any()),
            drops_out=bool(now.dropout.any()),
            delays=bool(now.delay_s.any()),
            degrades=bool(now.profile.any()),
        )


def _merged(ruled: Mask, one: Of, other: Of) -> Of:
    fields: Any = zip(one, other, strict=True)
    return type(one)(*(np.where(ruled, mine, others) for mine, others in fields))
