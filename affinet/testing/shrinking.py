"""The smallest of what breaks something: candidates flown side by side, and nothing taken that has not broken it itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice

from affinet.testing.reducing import AXES, Ground
from affinet.testing.trial import Trial

AT_ONCE = 48  # candidates that fly side by side


def smallest(
    trial: Trial,
    ground: Ground,
    breaks: Callable[[Sequence[Trial]], Sequence[bool]],
    watch: Callable[[Trial], None],
) -> Trial:
    """The smallest found of what breaks something, to the step along every axis.

    Parameters
    ----------
    trial
        What breaks it.
    ground
        The scenarios of trials.
    breaks
        Which of some trials break it.
    watch
        Told of each that is smaller.
    """
    known: dict[str, bool] = {}
    before = None
    while trial is not before:
        before = trial
        for axis in AXES:
            while (found := _first(axis(trial, ground), breaks, known)) is not None:
                trial = found
                watch(trial)
    return trial


def _first(
    candidates: Iterator[Trial], breaks: Callable[[Sequence[Trial]], Sequence[bool]], known: dict[str, bool]
) -> Trial | None:
    """The first of the candidates that breaks it; what did not break it once is not asked again."""
    hopeful = (one for one in candidates if known.get(one.key, True))
    while some := [*islice(hopeful, AT_ONCE)]:
        new = [*{one.key: one for one in some if one.key not in known}.values()]
        known.update(zip((one.key for one in new), breaks(new), strict=True))
        found = next((one for one in some if known[one.key]), None)
        if found is not None:
            return found
    return None
