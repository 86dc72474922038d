"""`affinet score`: what an estimator or a law is worth over a network, against the others."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich import progress as bar
from rich.console import Console

from affinet.cli.notes import note
from affinet.cli.progress import Bar
from affinet.cli.show import plain
from affinet.cli.status import PASS
from affinet.runtimes.interruption import ended_by_signals
from affinet.scenario import files
from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from affinet.score import card as cards
from affinet.score import flying, judging, measures, page, record, scoring
from affinet.score.flying import Cell
from affinet.score.scoring import Kept, Piece
from affinet.studies import cluster, identity, pool
from affinet.studies.executor import Executor
from affinet.studies.identity import Module

PAGE = "score.html"


def fly_and_report(parsed: argparse.Namespace) -> int:
    """Fly a score, and leave its page and its file.

    Raises
    ------
    ScenarioError, UserCodeError, OSError
        When it cannot fly, or its directory is another's.
    """
    card = cards.load(parsed.card)
    card = card.quickly() if parsed.quick else card
    key = "agents.law" if parsed.law else "agents.estimator"
    who = scoring.entrants(card, parsed.name, parsed.against, laws=parsed.law)
    folder = files.working_directory()
    todo = list(scoring.pieces(card, who, key, folder))
    own = _own_modules(todo)
    flies = _flies(own)
    out = _directory(parsed)
    pieces = out / scoring.PIECES
    pieces.mkdir(parents=True, exist_ok=True)
    kept = Kept(pieces, {name: identity.digest(sorted(of.items())) for name, of in flies.items()}, _damaged)
    with ended_by_signals(), _executor(parsed, own) as executor, _bar(parsed.name, len(todo)) as shown:
        found = scoring.fly(todo, executor, kept, lambda done: shown.see(done, f"{done}/{len(todo)} pieces"))
    if kept.there:
        note(f"{kept.there} of {len(todo)} pieces were there")
    raw = scoring.together(card, who, todo, found)
    score = judging.judge(raw)
    said = record.plain(card, raw, score, flies[parsed.name], quick=parsed.quick)
    record.write(out, said)
    (out / PAGE).write_text(page.page(card, raw, score, quick=parsed.quick), encoding="utf-8")
    if parsed.json:
        print(json.dumps(said, allow_nan=False))  # noqa: T201
    else:
        console = Console()
        for sentence in score.words:
            console.print(plain(f"- {one_line(sentence)}"), soft_wrap=True)
        console.print(plain(f"{out / PAGE} has all of it, {out / record.FILE} for programs"), soft_wrap=True)
    return PASS


def _damaged(file: Path) -> None:
    note(f"{file} is not whole: it flies anew")


@contextmanager
def _executor(parsed: argparse.Namespace, own: Mapping[str, set[Module]]) -> Iterator[Executor]:
    if parsed.dask is None:
        yield pool.on_this_machine(parsed.jobs)
        return
    with cluster.connected(parsed.dask, sorted(set().union(*own.values()))) as workers:
        yield workers


def _bar(name: str, pieces: int) -> Bar:
    return Bar(name, pieces, bar.BarColumn(), bar.TextColumn("{task.fields[says]}"), says="starting")


def _directory(parsed: argparse.Namespace) -> Path:
    """Where it goes on, or begins: pieces that are there, of the same code, do not fly again."""
    out: Path = parsed.out or Path("scores") / (parsed.name.replace(":", "-") + ("-quick" if parsed.quick else ""))
    file = out / record.FILE
    if file.exists():
        scored, size = record.of_whom(file)
        if (scored, size) != (parsed.name, "quick" if parsed.quick else "full"):
            raise FileExistsError(f"{str(out)!r} holds the {size} score of {scored}; name another directory with --out")
    return out


def _own_modules(todo: Sequence[Piece]) -> dict[str, set[Module]]:
    """Modules of a user's own that each entrant flies by.

    Raises
    ------
    ScenarioError
        When one of them suits no task.
    """
    own, why = dict[str, set[Module]](), dict[str, str]()
    for piece in todo:
        if piece.kind == "timed" and isinstance(piece.given, Cell):
            if (says := flying.unsuited(piece.given)) is None:
                own.setdefault(piece.entrant, set()).update(identity.own_modules(piece.given.plans((1,))))
            else:
                why.setdefault(piece.entrant, says)
    for name, says in why.items():
        if name not in own:
            raise ScenarioError(f"{name} suits none of the tasks: {says}")
    return own


def _flies(own: Mapping[str, set[Module]]) -> dict[str, dict[str, str]]:
    """Of whose code the bits of each entrant come; what lies beside a module may be imported as it flies."""
    code = identity.digest([Path(str(module.__file__)).read_bytes() for module in (flying, measures)])
    return {
        name: {**identity.here(sorted(of)), **_beside(folder for _, folder in of), "the score": code}
        for name, of in own.items()
    }


def _beside(folders: Iterable[str]) -> dict[str, str]:
    return {
        f"beside in {folder}": identity.digest(
            [(file.name, file.read_bytes()) for file in sorted(Path(folder).glob("*.py"))]
        )
        for folder in folders
    }
