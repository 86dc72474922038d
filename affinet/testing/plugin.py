"""The pytest plugin: fixture `swarm`, marks for seeds and runtime, and a report that says how to fly and check a failure again.

What it needs is imported when a test asks for it: pytest loads this file in every environment where affinet is installed.
"""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING

import pytest

from affinet import rooms

if TYPE_CHECKING:
    from affinet.testing.swarm import SwarmRuns

_SEEDS, _RUNTIME = "affinet_seeds", "affinet_runtime"
_RUNTIMES = ("inprocess", "processes")
_MOST = 2**64  # seeds are below
_COMMANDS = 50  # of other seeds that fail
_MOST_SEEDS = 10_000  # each is a test for each that there is
_RUNS: pytest.StashKey[SwarmRuns] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Where the swarms of tests fly, and with how many seeds."""
    group = parser.getgroup("affinet")
    group.addoption(
        "--affinet-seeds",
        type=_number_of_seeds,
        metavar="N",
        help="every test of a swarm with each of the seeds 1 to N, where no mark of its own says which",
    )
    group.addoption(
        "--affinet-runtime",
        choices=_RUNTIMES,
        default="inprocess",
        help="where the swarms of tests fly: in the test's process, or each agent as a process (default: %(default)s)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """The marks."""
    config.addinivalue_line("markers", f"{_SEEDS}(*seeds): run the test once with each of these seeds of all draws")
    config.addinivalue_line("markers", f"{_RUNTIME}(name): fly in this runtime, whatever the command line says")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test for each seed asked for; marks that say what cannot be fail when tests are collected."""
    for one in metafunc.definition.iter_markers():
        if (wrong := _wrong(one)) is not None:
            pytest.fail(f"{metafunc.definition.nodeid}: {wrong}", pytrace=False)
    mark, number = metafunc.definition.get_closest_marker(_SEEDS), metafunc.config.getoption("--affinet-seeds")
    seeds = mark.args if mark else range(1, number + 1) if number else ()
    if seeds and "swarm" in metafunc.fixturenames:
        metafunc.parametrize("swarm", seeds, indirect=True, ids=[f"seed{seed}" for seed in seeds])


def _number_of_seeds(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= _MOST_SEEDS:
        raise argparse.ArgumentTypeError(
            f"{text!r}: give how many seeds, from 1 to {_MOST_SEEDS}; runs of more fly sooner by swarm.fly(seeds=)"
        )
    return int(text)


def _wrong(mark: pytest.Mark) -> str | None:
    """What is wrong with a mark of ours, and how to write it."""
    if mark.name not in (_SEEDS, _RUNTIME):
        return None
    if mark.kwargs:
        return f"{mark.name} has no keyword {next(iter(mark.kwargs))!r}: {_right(mark.name)}"
    if mark.name == _RUNTIME:
        return (
            None
            if mark.args in [(one,) for one in _RUNTIMES]
            else f"{_RUNTIME}({', '.join(map(repr, mark.args))}): {_right(_RUNTIME)}"
        )
    if not mark.args:
        return f"{_SEEDS} has no seed: {_right(_SEEDS)}"
    if odd := [seed for seed in mark.args if type(seed) is not int or not 0 <= seed < _MOST]:
        return f"{_SEEDS}: {odd[0]!r} is no seed: {_right(_SEEDS)}"
    if twice := [seed for place, seed in enumerate(mark.args) if seed in mark.args[:place]]:
        return f"{_SEEDS}: {twice[0]} is given twice: {_right(_SEEDS)}"
    return None


def _right(name: str) -> str:
    if name == _RUNTIME:
        return f"write {' or '.join(f'{_RUNTIME}({one!r})' for one in _RUNTIMES)}"
    return f"write {_SEEDS}(1, 2, 3), different whole numbers from 0 to 2**64 - 1"


@pytest.fixture
def swarm(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SwarmRuns]:
    """Builds runs: `swarm("corridor").fault("cut", links=["6-7"], at=2).fly().check(bounded(1.0))`."""
    try:
        rooms.refuse_shadows()
    except rooms.RoomShadowed as error:
        pytest.fail(str(error), pytrace=False)
    from affinet.testing.swarm import SwarmRuns

    mark = request.node.get_closest_marker(_RUNTIME)
    runtime = mark.args[0] if mark else request.config.getoption("--affinet-runtime")
    seed = getattr(request, "param", None)
    runs = SwarmRuns(runtime, seed, lambda: tmp_path_factory.mktemp("affinet"), request.path.parent)
    request.node.stash[_RUNS] = runs
    yield runs
    if not runs.failed:
        runs.clear()
        if runs.unasked:
            pytest.fail(
                "fly(seeds=...) was asked nothing, and nothing has flown: `.check(...)` what should hold", pytrace=False
            )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Keep the runs of a test that failed, and say where they are and how to fly them again."""
    report = yield
    runs = item.stash.get(_RUNS, None)
    if report.when == "call" and report.failed and runs is not None:
        runs.failed = True
        report.sections += [("affinet run", says) for says in _kept(runs)]
        report.sections += [("affinet check", f"check again: {_checked_again(item)}")]
    return report


def _kept(runs: SwarmRuns) -> list[str]:
    from affinet.runtimes.directories import on_a_command_line

    try:
        return _kept_of_many(runs) + [
            f"seed {plan.scenario.seed}, {runs.runtime}\nrecording: {out / 'run.rrd'}\n"
            f"fly the same bits again: affinet replay {on_a_command_line(out)} --runtime {runs.runtime}"
            for plan, out in runs.keep()
        ]
    except Exception as error:  # noqa: BLE001 - whatever goes wrong here, the test's own failure is what counts
        return [f"the run could not be recorded: {error!r}"]


def _kept_of_many(runs: SwarmRuns) -> list[str]:
    """The worst run of many seeds, over processes, and a command for each of those that fail."""
    from affinet.runtimes.directories import on_a_command_line

    said = []
    for kept in runs.keep_worst():
        where = on_a_command_line(kept.out)
        replay, passes = f"affinet replay {where} --runtime inprocess --seed", kept.passing is not None
        at = "" if kept.worst.at is None else f" --at {kept.worst.at:g}"
        said.append(
            "\n".join(
                [
                    f"seed {kept.worst.seed}, the worst of {1 + len(kept.others)} that fail, processes",
                    f"recording: {kept.out / 'run.rrd'}",
                    f"fly the same bits again: affinet replay {where}",
                    *(
                        [f"where it parts from one that passes: affinet diff {where} --seed {kept.passing}{at}"]
                        * passes
                    ),
                    *(["the others that fail:"] if kept.others else []),
                    *(f"{replay} {one.seed}" for one in kept.others[:_COMMANDS]),
                    *([f"... and {len(kept.others) - _COMMANDS} more"] if len(kept.others) > _COMMANDS else []),
                ]
            )
        )
    return said


def _checked_again(item: pytest.Item) -> str:
    """The command that flies and checks in this test alone, from where pytest was called."""
    file = os.path.relpath(item.path, item.config.invocation_params.dir)
    runtime = item.config.getoption("--affinet-runtime")
    where = "" if runtime == _RUNTIMES[0] else f" --affinet-runtime={runtime}"
    if (number := item.config.getoption("--affinet-seeds")) is not None:
        where += f" --affinet-seeds={number}"  # by which the test has its name
    _, _, test = item.nodeid.partition("::")
    return f"pytest {shlex.quote(f'{file}::{test}')}{where}"
