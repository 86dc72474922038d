"""Swarms and parts in them that an agent has to be ready for."""

from __future__ import annotations

from affinet.conformance import flights
from affinet.conformance.case import Case
from affinet.conformance.cases.air import goes_on

_BRIEF, _SENSE = "An agent's life, 1. Brief", "An agent's life, 3. Sense"

CASES = (
    Case("large", "fly with more than fifty neighbours, among two hundred agents", _BRIEF, flights.LARGE, goes_on),
    Case("space", "fly in three dimensions", _BRIEF, flights.SPACE, goes_on),
    Case("leader", "fly as a leader, who is told its position", _SENSE, flights.LEADING, goes_on),
    Case("double", "fly as a double integrator, who is told its velocity", _SENSE, flights.DOUBLE, goes_on),
)
