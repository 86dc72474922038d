"""A case of the suite: what is demanded, where docs/protocol.md says so, and what shows whether an agent does it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from affinet.conformance.flights import Flight
from affinet.conformance.record import Record

Check = Callable[[Record], Iterator[str]]


class NotApplicable(Exception):
    """A flight in which an agent had no occasion to do it, nor not to: why."""


@dataclass(frozen=True)
class Case:
    """Something that an agent has to do.

    Parameters
    ----------
    name
        Of the case, one word.
    demand
        What it has to do.
    section
        Where docs/protocol.md says so.
    flight
        What shows it.
    check
        Says what came instead; nothing where it does what it has to.
    shown_early
        Whether nothing that happens later in the flight could show otherwise.
    """

    name: str
    demand: str
    section: str
    flight: Flight
    check: Check
    shown_early: bool = False
