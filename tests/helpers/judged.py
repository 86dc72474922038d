"""Runs to be judged: short, coarse, flown once, and then tampered with."""

from dataclasses import replace
from functools import cache

from flying import plan_of

from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts.evidence import Evidence

COARSE = ("time.dt=0.05", "time.duration=4")


@cache
def evidence(*overrides: str) -> Evidence:
    """The corridor for 80 ticks of 0.05 s."""
    return rehearse(plan_of("corridor", *COARSE, *overrides))


def tampered(honest: Evidence, **arrays) -> Evidence:
    """The same run with other arrays."""
    return replace(honest, arrays=honest.arrays | arrays)


def changed(array, place, value):
    """The array with another value in one place."""
    array = array.copy()
    array[place] = value
    return array
