"""Messages under way in a run in real time: a heap by the moment in which each is due."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from typing import Generic, NamedTuple, TypeVar

from netem.medium.open_tick import OpenTick
from netem.medium.verdict import PASSED

Said = TypeVar("Said")


class Parcel(NamedTuple, Generic[Said]):
    """A message on its way to one receiver; parcels are ordered by when they are due.

    Parameters
    ----------
    due_s
        When it is due, in simulated seconds.
    sent, link, channel, is_copy
        Which message it is: the tick in which it was sent, its link and channel, and whether it is a copy.
    content
        The tick it speaks of.
    mark
        How it is corrupted.
    said_s
        When it was said, in simulated seconds.
    origin
        What is known of the tick in which it was sent.
    said
        What was said.
    """

    due_s: float
    sent: int
    link: int
    channel: int
    is_copy: bool
    content: int
    mark: int
    said_s: float
    origin: OpenTick
    said: Said


class Parcels(Generic[Said]):
    """All that is under way."""

    def __init__(self) -> None:
        self._heap: list[Parcel[Said]] = []
        self._held: list[Parcel[Said]] = []

    def __len__(self) -> int:
        return len(self._heap) + len(self._held)

    @property
    def next_s(self) -> float | None:
        """When the next one is due, in simulated seconds."""
        return self._heap[0].due_s if self._heap else None

    def put(self, parcel: Parcel[Said]) -> None:
        """A message sets out."""
        heapq.heappush(self._heap, parcel)

    def due(self, now_s: float, is_held: Callable[[int], bool]) -> list[Parcel[Said]]:
        """Those that arrive by now, in the order in which they are due; they are under way no longer.

        Parameters
        ----------
        now_s
            In simulated seconds.
        is_held
            Whether messages on a link wait.
        """
        arriving: list[Parcel[Said]] = []
        while self._heap and self._heap[0].due_s <= now_s:
            parcel = heapq.heappop(self._heap)
            (self._held if is_held(parcel.link) else arriving).append(parcel)
        return arriving

    def under(
        self, doom: Sequence[int], holds: Sequence[bool]
    ) -> tuple[list[tuple[Parcel[Said], int]], list[Parcel[Said]]]:
        """What new conditions make of them: those that are dropped, each with the reason, and those that were held until now.

        Parameters
        ----------
        doom, holds
            Why messages under way on each link are dropped, or `PASSED`, and where they wait.
        """
        dropped = [(parcel, doom[parcel.link]) for parcel in (*self._heap, *self._held) if doom[parcel.link] != PASSED]
        if dropped:
            self._heap = [parcel for parcel in self._heap if doom[parcel.link] == PASSED]
            heapq.heapify(self._heap)
        held = [parcel for parcel in self._held if doom[parcel.link] == PASSED]
        self._held = [parcel for parcel in held if holds[parcel.link]]
        return sorted(dropped, key=lambda one: one[0][:5]), [parcel for parcel in held if not holds[parcel.link]]
