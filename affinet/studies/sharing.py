"""How the runs of a study are shared out: into batches that fly at once, each by one process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import reduce
from itertools import accumulate, pairwise
from typing import NamedTuple

from affinet.planning.plan import Plan
from affinet.runtimes.alike import alike
from affinet.studies.batch import AT_ONCE, Runs


class Piece(NamedTuple):
    """Runs of one case of a study: which case, and which of its runs."""

    case: int
    runs: range


Batch = tuple[Piece, ...]


def missing(there: Iterable[Piece], cases: int, runs: int) -> list[Piece]:
    """The pieces that are not there, of so many runs of each case."""
    of_case: dict[int, list[range]] = {case: [] for case in range(cases)}
    for case, some in sorted(there, key=lambda piece: (piece.case, piece.runs.start)):
        of_case[case].append(some)
    gaps = (
        Piece(case, range(before.stop, after.start))
        for case, some in of_case.items()
        for before, after in pairwise([range(0), *some, range(runs, runs)])
    )
    return [gap for gap in gaps if gap.runs]


def batches(plans: Sequence[Plan], wanted: Sequence[Piece], at_once: int) -> list[Batch]:
    """Batches of these runs, in the order of the plans.

    Plans that are alike fly together, at most `AT_ONCE` runs in a batch. There are as many batches as keep all busy who fly
    them to the end, if there are as many runs: those of a group are of one size, and so are about equally long under way.

    Parameters
    ----------
    plans, wanted
        Of the cases, and which of their runs to fly, in the order of the cases.
    at_once
        How many batches are flown at a time.
    """
    groups = [own for group in _groups(plans) if (own := [piece for piece in wanted if piece.case in group])]
    whole = [sum(len(piece.runs) for piece in group) for group in groups]
    parts = [-(-number // AT_ONCE) for number in whole]
    while sum(parts) % at_once:
        sizes = [number / among for number, among in zip(whole, parts, strict=True)]
        largest = sizes.index(max(sizes))
        if sizes[largest] <= 1.0:
            break
        parts[largest] += 1
    cut = [batch for group, number in zip(groups, parts, strict=True) for batch in _cut(group, number)]
    return sorted(cut, key=lambda batch: batch[0].case)


def in_turn(coming: Iterable[tuple[Piece, Runs]], cases: int, runs: int) -> Iterator[Runs]:
    """All runs of each of so many cases, so many of each, as soon as they and those of the cases before are there.

    Parameters
    ----------
    coming
        The pieces with what came of them, in whatever order.
    cases, runs
        How many there are.
    """
    pieces = iter(coming)
    there: dict[int, dict[int, Runs]] = {case: {} for case in range(cases)}
    left = [runs] * cases
    for case in range(cases):
        while left[case]:
            piece, flown = next(pieces)
            there[piece.case][piece.runs.start] = flown
            left[piece.case] -= len(piece.runs)
        yield reduce(Runs.together, (flown for _, flown in sorted(there.pop(case).items())))


def flown_by_case(
    shares: Sequence[float], shared: Sequence[Batch], there: Iterable[Piece], cases: int, runs: int
) -> list[float]:
    """Which share of so many runs of each case has flown, from those of the batches, and the pieces that were there."""
    flown = [0.0] * cases
    for piece in there:
        flown[piece.case] += len(piece.runs) / runs
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


def _cut(group: Sequence[Piece], parts: int) -> Iterator[Batch]:
    """The runs of a group, one piece after the other, in parts of about the same size."""
    ends = [*accumulate((len(piece.runs) for piece in group), initial=0)]
    for part in range(parts):
        first, end = ends[-1] * part // parts, ends[-1] * (part + 1) // parts
        yield tuple(
            Piece(case, some[max(first - before, 0) : end - before])
            for before, (case, some) in zip(ends, group, strict=False)
            if before < end and before + len(some) > first
        )
