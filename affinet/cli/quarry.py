"""What is hunted, as a command line says it, who flies it, and where what is found goes."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Sequence
from contextlib import closing
from itertools import product
from pathlib import Path

from affinet.cli import show
from affinet.cli.given import scenario
from affinet.cli.varied import swept
from affinet.planning import making as planning
from affinet.runtimes import directories
from affinet.runtimes.run import evidence, fly
from affinet.scenario import files, loading
from affinet.scenario.sections import Scenario
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError
from affinet.studies import pool
from affinet.testing import flights, menu
from affinet.testing.flights import Chunk, Each
from affinet.testing.hunt import Counterexample, Quarry
from affinet.testing.trial import Settings
from netem.processes.system_errors import about

_WORTH_PROCESSES = 20_000  # ticks of runs, below which starting them takes longer


def quarry_of(parsed: argparse.Namespace) -> Quarry:
    """What is hunted, as the command line says it.

    Raises
    ------
    ScenarioError
        When something in it is wrong.
    """
    make = flights.said(parsed.invariant)
    verbs = parsed.verbs or list(menu.VERBS)
    if strangers := sorted(set(verbs) - set(menu.VERBS)):
        raise ScenarioError(f"--verbs {','.join(strangers)}: {among(strangers[0], menu.VERBS)}")
    combined = product(*([f"{key}={value}" for value in values] for key, values in swept(parsed)))
    scenarios: dict[Settings, Scenario] = {settings: scenario(parsed, settings) for settings in combined}
    seeds = parsed.seeds or [next(iter(scenarios.values())).seed]
    return Quarry(make, scenarios, list(seeds), verbs)


def flown_by(jobs: int | None) -> Each:
    """What flies chunks of trials: the first here, and all others, where that takes long, in so many processes."""

    def each(work: flights.Work, chunks: Sequence[Chunk]) -> Generator[tuple[int, flights.Made], None, None]:
        ticks, here = 0, 0
        while here < len(chunks) and ticks < _WORTH_PROCESSES:
            ticks += sum(case.given.time.ticks for case in chunks[here])
            here += 1
        yield from enumerate(map(work, chunks[:here]))
        if here < len(chunks):
            executor = pool.on_this_machine(jobs)
            with closing(executor.each(work, chunks[here:], lambda _: None)) as flown:
                yield from ((here + number, made) for number, made in flown)

    return each


def write(given: Scenario, file: Path) -> None:
    """Write a scenario into its file.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    with about(file):
        file.write_text(loading.to_toml(given), encoding="utf-8")


def places_of(parsed: argparse.Namespace, quarry: Quarry) -> list[Path]:
    """A new, empty file for what breaks each invariant.

    Raises
    ------
    ScenarioError, OSError
        When it cannot be there, or is already.
    """
    out: Path | None = parsed.out
    if out:
        directories.refuse_nowhere(out, "--out")
    folder = out.absolute().parent if out else files.working_directory()
    for name, lies_in in (pair for given in quarry.scenarios.values() for pair in given.own_modules.items()):
        if folder != lies_in:
            raise ScenarioError(f"--out {out or '.'}: {name} lies in {lies_in}: write the file there")
    numbers = range(1, len(parsed.invariant) + 1)
    if out is None:
        return [directories.for_hunt(Path(parsed.scenario).stem) for _ in numbers]
    return [directories.for_hunt(out if number == 1 else out.with_stem(f"{out.stem}-{number}")) for number in numbers]


def confirm(counterexample: Counterexample, quarry: Quarry, file: Path) -> None:
    """Fly the smallest fault over processes, and say what came of it.

    Raises
    ------
    OSError
        When it leaves no run directory.
    """
    plan = planning.make(loading.load(str(file)))
    out = directories.for_run(file.stem)
    with show.Progress(plan, file.stem, out) as watch:
        flown = fly(plan, "processes", out, watch.see)
    same = "the same bits" if flown.digest == counterexample.digest else "OTHER BITS"
    landed = evidence(plan, flown)
    found = quarry.make()[counterexample.number](landed) if landed else "; ".join(flown.reasons)
    print(f"over processes, {same}: {found}\n{file}: affinet run {directories.on_a_command_line(file)}")  # noqa: T201
