"""An earlier run's journal as the judge of another, or as the air that another meets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.arrow import places
from netem.core.channels import SENSE
from netem.core.links import Links
from netem.impairments.corrupt import Mark
from netem.medium.in_flight import Verdicts
from netem.medium.journal import JournalError
from netem.medium.rows import VERDICTS
from netem.medium.verdict import BY_THE_AIR, Verdict

_DELAYED, _DROPPED, _COPIED, _RELEASED = map(VERDICTS.index, ("delayed", "dropped", "copied", "released"))
_REASON = np.array([kind.label for kind in Verdict])
_MARK = np.array([mark.label for mark in Mark])


def check(table: Any, channels: Sequence[str], ticks: int) -> None:
    """Whether a journal can judge a run of these channels and so many ticks.

    Raises
    ------
    JournalError
        When it cannot.
    """
    last = int(table["tick"].to_numpy().max(initial=-1))
    if last + 1 < ticks:
        raise JournalError(f"the journal ends after {last + 1} ticks, the run has {ticks}; shorten time.duration")
    if missing := [name for name in channels if name not in table["channel"].unique().to_pylist()]:
        raise JournalError(f"the journal has no verdicts on {', '.join(missing)}: it is of a run without such agents")


class Carried(NamedTuple):
    """What the air carried in an earlier run.

    Parameters
    ----------
    share
        Of the channels' messages, shape (T, L): 0 where the air lost them. Scripted faults, and agents that were silent, are
        not the air: there it is 1.
    known
        Links of which the journal says anything, shape (L,).
    untold
        Ticks and links where nothing was offered, or a fault held all of it, shape (T, L).
    """

    share: Array
    known: Mask
    untold: Mask


def carried(table: Any, links: Links, *, sensing: bool) -> Carried:
    """What the air carried.

    Parameters
    ----------
    table
        The journal of a run.
    links
        Of the run that will meet this air.
    sensing
        Whether to take the verdicts on measurements, or on all that was communicated.

    Raises
    ------
    JournalError
        When it has none of them.
    """
    names = [name for name in table["channel"].unique().to_pylist() if (name == SENSE) is sensing]
    if not names:
        raise JournalError(f"the journal has no verdicts on {'sensing' if sensing else 'communication'}")
    kind = Recorded(table, links, names).kind
    offered, lost = kind != Verdict.SILENT, np.isin(kind, BY_THE_AIR)
    by_air = lost | (kind == Verdict.DELIVERED) | (kind == Verdict.DELAYED)
    share = 1.0 - lost.sum(axis=1) / np.maximum(offered.sum(axis=1), 1)
    return Carried(share, offered.any(axis=(0, 1)), ~by_air.any(axis=1))


class Recorded:
    """The verdicts of an earlier run, whatever was their cause.

    Parameters
    ----------
    table
        Its journal.
    links, channels
        Of the run that is to be judged.
    """

    def __init__(self, table: Any, links: Links, channels: Sequence[str]) -> None:
        tick, src, dst, due = (table[name].fill_null(-1).to_numpy() for name in ("tick", "src", "dst", "deliver_tick"))
        verdict = places(table["verdict"], VERDICTS)
        kind = np.maximum(places(table["reason"], _REASON), 0)
        channel = places(table["channel"], channels)
        seq = table["seq"].to_numpy()
        size = links.agents + 1
        row_of = np.full((size, size), -1)
        row_of[links.src, links.dst] = np.arange(len(links))
        here = (src < size) & (dst < size)
        link = np.where(here, row_of[np.where(here, src, 0), np.where(here, dst, 0)], -1)
        shape = (int(tick.max(initial=-1)) + 1, len(channels), len(links))
        self.kind = np.zeros(shape, dtype=np.uint8)
        self.due = np.broadcast_to(np.arange(shape[0])[:, None, None], shape).copy()
        self.mark = np.zeros(shape, dtype=np.uint8)
        self.copy_due = np.full(shape, -1)
        known = (channel >= 0) & (link >= 0)
        # A row of a message under way is not the first of its number.
        first = known & _first_of_message(channel, link, seq, len(links), verdict)
        at = tick[first], channel[first], link[first]
        passed = np.where(verdict == _DELAYED, Verdict.DELAYED, Verdict.DELIVERED)
        self.kind[at] = np.where(verdict == _DROPPED, kind, passed)[first]
        self.due[at] = np.where(due < 0, tick, due)[first]
        self.mark[at] = np.maximum(places(table["mark"], _MARK), 0)[first]
        doubled = known & (verdict == _COPIED)
        self.copy_due[tick[doubled], channel[doubled], link[doubled]] = due[doubled]

    def verdicts(self, tick: int, offered: Mask) -> Verdicts:
        """What was decided of the messages of a tick.

        Raises
        ------
        JournalError
            When a message is offered of which the journal says nothing.
        """
        if tick >= len(self.kind):
            raise JournalError(f"the journal ends before tick {tick}")
        kind = np.where(offered, self.kind[tick], np.uint8(Verdict.SILENT))
        if (offered & (kind == Verdict.SILENT)).any():
            raise JournalError(f"the journal has no verdict on some messages of tick {tick}: were other agents flown?")
        return Verdicts(kind, self.due[tick], self.mark[tick], np.where(offered, self.copy_due[tick], -1))


def _first_of_message(channel: Integers, link: Integers, seq: Integers, links: int, verdict: Integers) -> Mask:
    offer = (verdict != _COPIED) & (verdict != _RELEASED)
    identity = (channel * links + link) * (int(seq.max(initial=0)) + 1) + seq
    first = np.zeros(len(seq), dtype=bool)
    rows = np.flatnonzero(offer)
    first[rows[np.unique(identity[rows], return_index=True)[1]]] = True
    return first
