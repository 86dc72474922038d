"""How the runs of a study are shared out: into batches that fly at once, each by one process."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import reduce
from typing import NamedTuple

from affinet.planning.plan import Plan
from affinet.runtimes.alike import alike
from affinet.studies.batch import AT_ONCE, Runs


class Piece(NamedTuple):
    """Runs of one case of a study: which case, and which of its runs."""

    case: int
    runs: range


Batch = tuple[Piece, ...]


def batches(plans: Sequence[Plan], runs: int, processors: int) -> list[Batch]:
    """Batches of so many runs of each plan, in the order of the plans.

    Plans that are alike fly together, at most `AT_ONCE` runs in a batch. There are as many batches as keep all processors busy
    to the end, if there are as many runs: those of a group are of one size, and so are about equally long under way.

    Parameters
    ----------
    plans, runs
        Of the cases, and how many runs each has.
    processors
        How many there are.
    """
    groups = _groups(plans)
    parts = [-(-len(group) * runs // AT_ONCE) for group in groups]
    while sum(parts) % processors:
        sizes = [len(group) * runs / number for group, number in zip(groups, parts, strict=True)]
        largest = sizes.index(max(sizes))
        if sizes[largest] <= 1.0:
            break
        parts[largest] += 1
    cut = [batch for group, number in zip(groups, parts, strict=True) for batch in _cut(group, runs, number)]
    return sorted(cut, key=lambda batch: batch[0].case)


def in_turn(shared: Sequence[Batch], flown: Iterable[Sequence[Runs]], cases: int) -> Iterator[Runs]:
    """All runs of each of so many cases, as soon as they and those of the cases before are there.

    Parameters
    ----------
    shared, flown
        The batches, and what came of the pieces of each, in their order.
    cases
        How many there are.
    """
    coming = zip(shared, flown, strict=True)
    missing = Counter(piece.case for batch in shared for piece in batch)
    there: dict[int, list[Runs]] = {case: [] for case in range(cases)}
    for case in range(cases):
        while missing[case]:
            for piece, runs in zip(*next(coming), strict=True):
                there[piece.case].append(runs)
                missing[piece.case] -= 1
        yield reduce(Runs.together, there.pop(case))


def flown_by_case(shares: Sequence[float], shared: Sequence[Batch], cases: int, runs: int) -> list[float]:
    """Which share of so many runs of each case has flown, from those of the batches."""
    flown = [0.0] * cases
    for share, batch in zip(shares, shared, strict=True):
        for piece in batch:
            flown[piece.case] += share * len(piece.runs) / runs
    return flown


def _groups(plans: Sequence[Plan]) -> list[list[int]]:
    """Numbers of the plans, those that are alike together."""
    groups: list[list[int]] = []
    for number, plan in enumerate(plans):
        for group in groups:
            if alike(plans[group[0]], plan):
                group.append(number)
                break
        else:
            groups.append([number])
    return groups


def _cut(group: Sequence[int], runs: int, parts: int) -> Iterator[Batch]:
    """The runs of the cases of a group, one case after the other, in parts of about the same size."""
    whole = len(group) * runs
    for part in range(parts):
        first, end = whole * part // parts, whole * (part + 1) // parts
        yield tuple(
            Piece(case, range(max(first - before, 0), min(end - before, runs)))
            for before, case in zip(range(0, whole, runs), group, strict=True)
            if before < end and before + runs > first
        )
