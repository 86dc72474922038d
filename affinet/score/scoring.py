"""A score from its card: what has to fly, piece by piece, what of it has flown before, and all of it together."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from affinet.scenario.wrong import ScenarioError
from affinet.score import flying
from affinet.score.card import Scorecard, Task, Worsening
from affinet.score.flying import Cell, Descent, Entrant, Flown, Timed
from affinet.score.judging import Raw
from affinet.studies import identity
from affinet.studies.executor import Executor
from affinet.studies.sealed import opened, sealed
from netem.processes.system_errors import about
from netem.processes.whole import whole

PIECES = "pieces"
_OF_SEEDS = 25  # runs of a piece, so that one that is interrupted loses little
_NOISIER = "with worse sensors"

Made = Flown | list[float] | Timed | None


class Piece(NamedTuple):
    """A piece of a score: a kind of flight, and what flies."""

    kind: str
    task: str
    air: str
    entrant: str
    first: int
    given: Cell | Descent


@dataclass
class Kept:
    """What has flown, kept in a directory by what it is of: the same piece of the same code is not flown again.

    Parameters
    ----------
    folder
        Of the pieces.
    flies
        Of each entrant a digest of the code that its bits come of.
    damaged
        Told of each file that is not what was kept.
    """

    folder: Path
    flies: Mapping[str, str]
    damaged: Callable[[Path], None]
    there: int = field(default=0, init=False)
    _airs: dict[Any, str] = field(default_factory=dict, init=False)

    def read(self, todo: Sequence[Piece]) -> dict[int, Made]:
        """What came of those pieces that have flown, by their places."""
        found: dict[int, Made] = {}
        for number, piece in enumerate(todo):
            file = self._file(piece)
            if not file.exists():
                continue
            with about(file):
                packed = opened(file.read_bytes())
            name, made = json.loads(packed) if packed is not None else (None, None)
            if name != file.name:
                self.damaged(file)
                continue
            found[number] = _made(piece.kind, made)
        self.there = len(found)
        return found

    def keep(self, piece: Piece, made: Made) -> None:
        """Keep it."""
        file = self._file(piece)
        with about(file), whole(file) as unfinished:
            unfinished.write_bytes(sealed(json.dumps([file.name, made]).encode()))

    def _file(self, piece: Piece) -> Path:
        given = piece.given
        cell, worse = (given.cell, given.worsening) if isinstance(given, Descent) else (given, None)
        judged_by = (cell.task.lost, cell.task.recovered)
        of = [self.flies[piece.entrant], piece.kind, *cell.entrant[:2], cell.seeds, judged_by, self._air(cell, worse)]
        return self.folder / f"{identity.digest(of)}.piece"

    def _air(self, cell: Cell, worse: Worsening | None) -> str:
        """What is flown, whoever flies: from files of a user's own, which may say something else by now."""
        of = (cell.task.name, cell.set, worse and worse.name)
        if of not in self._airs:
            ends = [[]] if worse is None else [worse.at(worse.least_tried), worse.at(worse.most)]
            self._airs[of] = identity.of_plans(cell.nobody(more) for more in ends)
        return self._airs[of]


def entrants(card: Scorecard, name: str, against: Sequence[str], *, laws: bool) -> dict[str, list[str]]:
    """Who flies each task, the one that is scored first; without any to compare with, those that the card names.

    Parameters
    ----------
    card, name, against
        The card, who is scored, and with whom it is compared.
    laws
        Whether laws are compared.

    Raises
    ------
    ScenarioError
        When it is to be compared with itself.
    """
    if name in against:
        raise ScenarioError(f"--against {name}: that is the one that is scored; leave it out")
    return {
        task.name: list(dict.fromkeys([name, *(against or (task.laws if laws else task.rivals))]))
        for task in card.tasks
    }


def pieces(card: Scorecard, who: Mapping[str, Sequence[str]], key: str, folder: Path) -> Iterator[Piece]:
    """All that has to fly, dear ones first."""
    seeds = tuple(range(1, card.seeds + 1))
    for task in card.tasks:
        for name in who[task.name]:
            entrant = Entrant(key, name, str(folder))
            whole_cell = Cell(task, "", (), entrant, seeds, str(card.folder))
            for worsening in card.worsenings:
                yield Piece("descent", task.name, worsening.name, name, 0, Descent(whole_cell, worsening))
            for air in card.airs:
                yield from _cells(task, air.name, air.set, entrant, seeds, card.folder)
            if name in who[task.name][:2] and task.noisier and key.endswith("estimator"):
                first = card.airs[0]
                yield from _cells(task, _NOISIER, [*first.set, *task.noisier], entrant, seeds, card.folder)
    for task in card.tasks:
        for name in who[task.name]:
            cell = Cell(
                task,
                card.airs[0].name,
                tuple(card.airs[0].set),
                Entrant(key, name, str(folder)),
                (1,),
                str(card.folder),
            )
            yield Piece("timed", task.name, "", name, 0, cell)


def _cells(
    task: Task, air: str, overrides: Sequence[str], entrant: Entrant, seeds: Sequence[int], folder: Path
) -> Iterator[Piece]:
    for first in range(0, len(seeds), _OF_SEEDS):
        some = tuple(seeds[first : first + _OF_SEEDS])
        yield Piece(
            "cell", task.name, air, entrant.name, first, Cell(task, air, tuple(overrides), entrant, some, str(folder))
        )


def fly(todo: Sequence[Piece], executor: Executor, kept: Kept, watch: Callable[[int], None]) -> list[Made]:
    """What comes of every piece, in their order: flown now, or kept from before.

    Parameters
    ----------
    todo
        The pieces; what is timed flies at the end, one by one, in this process.
    executor
        Does the work.
    kept
        What has flown before, and where what flies now is kept.
    watch
        Told how many are done.
    """
    found = kept.read(todo)
    left = [number for number, piece in enumerate(todo) if number not in found and piece.kind != "timed"]
    watch(len(found))
    for place, made in executor.each(_fly, [todo[number] for number in left], lambda _: None):
        kept.keep(todo[left[place]], made)
        found[left[place]] = made
        watch(len(found))
    for number, piece in enumerate(todo):
        if number not in found:
            found[number] = _fly(piece)
            watch(len(found))
    return [found[number] for number in range(len(todo))]


def together(card: Scorecard, who: Mapping[str, Sequence[str]], flown: Sequence[Piece], found: Sequence[Made]) -> Raw:
    """All pieces put together."""
    cells: dict[tuple[str, str, str], Flown] = {}
    points: dict[tuple[str, str, str], list[float]] = {}
    times: dict[tuple[str, str], Timed] = {}
    for piece, made in zip(flown, found, strict=True):
        where = (piece.task, piece.air, piece.entrant)
        if isinstance(made, Flown):
            cells[where] = made if where not in cells else _longer(cells[where], made)
        elif isinstance(made, Timed):
            times[piece.task, piece.entrant] = made
        elif made:
            points[where] = made
    everybody = list(dict.fromkeys(name for names in who.values() for name in names))
    for task in card.tasks:
        for name in everybody:
            if name not in who[task.name]:
                for air in card.airs:
                    cells[task.name, air.name, name] = Flown({}, "the card does not compare with it")
    return Raw(
        tasks=card.tasks,
        airs=[air.name for air in card.airs],
        worsenings=card.worsenings,
        entrants=everybody,
        cells={where: made for where, made in cells.items() if where[1] != _NOISIER},
        noisier={
            (task, who): made for (task, air, who), made in cells.items() if air == _NOISIER and made.unsuited is None
        },
        points=points,
        times=times,
    )


def _longer(one: Flown, more: Flown) -> Flown:
    return Flown(
        {name: [*values, *more.runs[name]] for name, values in one.runs.items()}, one.unsuited or more.unsuited
    )


def _fly(piece: Piece) -> Made:
    given = piece.given
    if isinstance(given, Descent):
        return flying.descent(given)
    return flying.timed(given) if piece.kind == "timed" else flying.cell(given)


def _made(kind: str, said: Any) -> Any:
    if said is None or kind == "descent":
        return said
    return Timed(*said) if kind == "timed" else Flown(*said)
