"""Moments of runs, as said on a command line."""

from __future__ import annotations

from affinet.scenario.wrong import ScenarioError


def within(option: str, seconds: float, last: float) -> float:
    """The moment that an option says, of a run whose last tick is then.

    Raises
    ------
    ScenarioError
        When the run has no such moment.
    """
    if not 0.0 <= seconds <= last:
        raise ScenarioError(f"{option} {seconds:g}: give a moment from 0 to {last:g} s")
    return seconds
