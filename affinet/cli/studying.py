"""`affinet study`: what of it has flown is kept until all is reported, and a second call goes on from there."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from affinet.cli import means, show
from affinet.cli.notes import note
from affinet.cli.status import FAIL, PASS
from affinet.planning.plan import Plan
from affinet.runtimes import directories
from affinet.runtimes.interruption import ended_by_signals
from affinet.studies import cells, cluster, identity, judging, labelled, pool, record, report
from affinet.studies import study as studies
from affinet.studies.cells import Cells
from affinet.studies.executor import Executor, Lost
from affinet.studies.identity import Identity
from affinet.studies.sharing import flown_by_case
from affinet.studies.study import Case, Result, Study


def fly_and_report(parsed: argparse.Namespace) -> int:
    """Fly a study and leave its report, which fails where not all of it is there.

    Raises
    ------
    ScenarioError, UserCodeError, OSError
        When it cannot fly, or its directory is another's.
    """
    study = studies.load(parsed.study)
    planned = studies.plans(study, quick=parsed.quick)
    with _executor(parsed, [plan for _, plan in planned]) as executor:
        return PASS if _into_its_directory(study, planned, parsed, executor) else FAIL


@contextmanager
def _executor(parsed: argparse.Namespace, plans: Sequence[Plan]) -> Iterator[Executor]:
    if parsed.dask is None:
        yield pool.on_this_machine(parsed.jobs)
        return
    with cluster.connected(parsed.dask, identity.own_modules(plans)) as workers:
        yield workers


def _into_its_directory(
    study: Study, planned: Sequence[tuple[Case, Plan]], parsed: argparse.Namespace, executor: Executor
) -> bool:
    out = report.prepare(parsed.out or f"{Path(parsed.study).stem}{'-quick' if parsed.quick else ''}")
    of = identity.of_cells(study, [plan for _, plan in planned], quick=parsed.quick)
    with directories.unless_empty(out), cells.held(out, of, note) as kept:
        try:
            results = _flown(study, planned, parsed, executor, kept)
        except Lost as error:
            note(str(error))
            _go_on(kept)
            return False
        except KeyboardInterrupt:
            _go_on(kept)
            raise
        done = _reported(study, results, parsed, out, flown=of[identity.GRID])
        if done:
            kept.clear()
        return done


def _flown(
    study: Study, planned: Sequence[tuple[Case, Plan]], parsed: argparse.Namespace, executor: Executor, kept: Cells
) -> list[Result]:
    runs, results = study.size(quick=parsed.quick).runs, list[Result]()
    before = flown_by_case([], [], kept.there, len(planned), runs)
    if kept.there:
        note(f"{study.title}: goes on from {kept.runs} of {len(planned) * runs} runs")
    with ended_by_signals():
        try:
            with show.Grid(study.title, [plan.world.ticks for _, plan in planned], there=before) as grid:
                for result in studies.fly(planned, runs, executor, kept.there, kept.keep, grid.look):
                    results.append(result)
                    grid.see(result)
        finally:
            if results:  # whatever happened meanwhile, what was flown is to be seen
                labelled.write(kept.folder.parent, study, results, _about(parsed, kept.of))
    return results


def _about(parsed: argparse.Namespace, of: Identity) -> dict[str, str]:
    said = {"study": Path(parsed.study).stem, "size": "quick" if parsed.quick else "full", "flown": of[identity.GRID]}
    return said | {name: of[name] for name in identity.VERSIONS}


def _reported(study: Study, results: list[Result], parsed: argparse.Namespace, out: Path, *, flown: str) -> bool:
    try:
        verdicts = judging.judge(study, results)
        judged = record.recorded(study, results, verdicts, flown=flown, quick=parsed.quick)
        record.write(out, judged)
        means.of_study(judged, out)
        show.claims(judged, record.full_study(parsed.study), out)
        report.draw(out, study, results)
    except Exception as error:  # noqa: BLE001 - whatever a verdict or a picture fails of, the data is there, and it is said
        log = report.failed(out)
        where = "" if log is None else f"; {log} says where"
        note(f"{out} has the data, but not all of the report: {error!r}{where}")
        return False
    return True


def _go_on(kept: Cells) -> None:
    if kept.runs:
        out = directories.on_a_command_line(kept.folder.parent)
        note(f"{kept.runs} runs are kept: the same command goes on from them with --out {out}")
