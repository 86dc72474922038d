"""What a run over processes leaves: the verdicts of its journal, and what its agents noted, as arrays of the same messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels as channel_names
from netem.core.arrow import places
from netem.core.links import Links
from netem.impairments.corrupt import Mark
from netem.medium.in_flight import Verdicts
from netem.medium.relay import changed_on_the_way
from netem.medium.rows import VERDICTS
from netem.medium.verdict import Verdict

_DELIVERED, _DELAYED, _DROPPED, _COPIED = map(VERDICTS.index, ("delivered", "delayed", "dropped", "copied"))
_KINDS, _MARKS = ([one.label for one in names] for names in (Verdict, Mark))


class Noted(NamedTuple):
    """What agents noted.

    Parameters
    ----------
    links
        Those of the run.
    arrived
        Rows of (tick of the inbox, content tick, channel row, link row, whether it is not what was said), shape (m, 5).
    took_s
        How long each was under way, in simulated seconds; NaN of measurements, and in lockstep.
    empty
        Messages said without a number in them, which nothing can make wrong, shape (T, C, N).
    """

    links: Links
    arrived: Integers
    took_s: Array
    empty: Mask

    def of_these(self, expected: Integers) -> Integers:
        """The messages that `arriving.expected` has, in rows as these: whether each is not what was said, by its mark."""
        _, content, channel, _, mark = expected.T
        wrong = changed_on_the_way(mark) & ~self.empty[content, channel, self.links.src[expected[:, 3]] - 1]
        return np.column_stack([expected[:, :4], wrong])


def verdicts(table: Any, links: Links, channels: Sequence[str], ticks: int) -> Verdicts:
    """The verdicts of a journal in which nothing under way was dropped or held, shape (T, C, L)."""
    shape = (ticks, len(channels), len(links))
    said, at = places(table["verdict"], VERDICTS), _cells(table, links, channels)
    assert np.isin(said, (_DELIVERED, _DELAYED, _DROPPED, _COPIED)).all()
    kind, due, mark, copy = (
        np.zeros(shape, dtype=np.uint8),
        np.full(shape, -1),
        np.zeros(shape, dtype=np.uint8),
        np.full(shape, -1),
    )
    offered = said != _COPIED
    passed, of_offered = offered & (said != _DROPPED), tuple(place[offered] for place in at)
    reasons = places(table["reason"].fill_null(Verdict.SILENT.label), _KINDS)
    kind[of_offered] = np.select([said == _DELIVERED, said == _DELAYED], [Verdict.DELIVERED, Verdict.DELAYED], reasons)[
        offered
    ]
    mark[of_offered] = places(table["mark"].fill_null(Mark.NONE.label), _MARKS)[offered]
    arrives = table["deliver_tick"].fill_null(-1).to_numpy()
    due[tuple(place[passed] for place in at)] = arrives[passed]
    copy[tuple(place[~offered] for place in at)] = arrives[~offered]
    return Verdicts(kind, due, mark, copy)


def _cells(table: Any, links: Links, channels: Sequence[str]) -> tuple[Integers, Integers, Integers]:
    ends = np.stack([table[name].to_numpy() for name in ("src", "dst")], axis=-1)
    return table["tick"].to_numpy(), places(table["channel"], channels), rows_of(links, ends)


def rows_of(links: Links, ends: Integers) -> Integers:
    """Which links have these ends (m, 2)."""
    row = np.full((links.agents + 1, links.agents + 1), -1)
    row[links.src, links.dst] = np.arange(len(links))
    return row[ends[:, 0], ends[:, 1]]


def noted(files: Mapping[int, Path], links: Links, channels: Sequence[str], ticks: int) -> Noted:
    """What agents noted, each in a file of its own."""
    told = {agent: np.load(file) for agent, file in files.items()}
    heard = np.concatenate([np.insert(of["heard"], 4, agent, axis=1) for agent, of in told.items()])
    said = np.concatenate([np.insert(of["said"], 0, agent, axis=1) for agent, of in told.items()])
    codes = np.array([channel_names.code(name) for name in channels])
    order = np.argsort(codes)
    spoken, empty = (
        np.zeros((ticks, len(channels), links.agents), dtype=np.int64),
        np.zeros((ticks, len(channels), links.agents), dtype=bool),
    )
    agent, tick, code, digest, numbers = said.T
    cells = tick, order[np.searchsorted(codes[order], code)], agent - 1
    spoken[cells], empty[cells] = digest, numbers == 0
    tick, content, code, src, dst, digest = heard.T
    channel = order[np.searchsorted(codes[order], code)]
    rows = rows_of(links, np.stack([src, dst], axis=-1))
    arrived = np.column_stack([tick, content, channel, rows, spoken[content, channel, src - 1] != digest])
    return Noted(links, arrived, np.concatenate([of["took_s"] for of in told.values()]), empty)
