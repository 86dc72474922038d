"""`affinet watch`, and the watching of a run while it flies."""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from affinet.planning.blueprint import formation_of
from affinet.runtimes.interruption import ended_by_signals
from affinet.runtimes.rerun_command import NoViewer
from affinet.runtimes.viewers import WebViewer, open_viewer, show
from affinet.scenario import loading
from affinet.scenario.names import apart
from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from netem.core.parts import parts
from world.recording.file import RECORDING

_SOURCE = re.compile(r" at \S+\.rs:\d+:")  # where the viewer's makers had it fail, which is nothing to a user


def watch(parsed: argparse.Namespace) -> None:
    """Show what was flown until the viewer is closed, or the page no longer wanted.

    Raises
    ------
    ScenarioError
        When a directory holds no run, or one without a recording.
    NoViewer
        When nothing can be shown.
    """
    with _files(parsed.directories) as files:
        if not parsed.serve:
            try:
                with ended_by_signals():
                    show(files)
            except NoViewer as error:
                raise NoViewer(
                    f"{_why(error)}; --serve shows it in a browser, `affinet render` and `report` need neither"
                ) from error
            return
        with WebViewer(files) as web:
            _until_asked(web, f"{web.page}\nserved until Ctrl-C")


def _why(error: NoViewer) -> str:
    return _SOURCE.sub(":", str(error)).rstrip(".")


@contextmanager
def live(parsed: argparse.Namespace) -> Iterator[str | None]:
    """Where a run is streamed to, if it is watched; without a screen it flies all the same."""
    if parsed.serve:
        with WebViewer() as web:
            _tell(web.page)
            yield web.stream
            _until_asked(web, f"still at {web.page} until Ctrl-C")
        return
    try:
        viewer = open_viewer() if parsed.view else None
    except NoViewer as error:
        viewer = None
        _tell(one_line(f"{_why(error)}; it flies without: `affinet watch RUN` shows it later, --serve in a browser"))
    yield viewer


def _until_asked(web: WebViewer, says: str) -> None:
    with suppress(KeyboardInterrupt), ended_by_signals():
        _tell(says)
        web.wait()


@contextmanager
def _files(directories: Sequence[Path]) -> Iterator[list[Path]]:
    """The recording of a run; of several, one that has them all."""
    if len(directories) == 1:
        yield _recording(directories[0])
        return
    from world.recording.beside import RecordedRun, beside  # Rerun takes a second to import

    runs = []
    for name, directory in zip(apart(directories), directories, strict=True):
        flown = loading.resolved(directory)
        nominal = formation_of(flown).nominal
        reach, flat = float(np.ptp(nominal, axis=0).max()), nominal.shape[-1] == 2
        runs.append(RecordedRun(name, _recording(directory), flat, reach, flown.time.duration))
    with tempfile.TemporaryDirectory(prefix="affinet-") as folder:
        together = Path(folder) / RECORDING
        beside(runs, together)
        yield [together]


def _recording(directory: Path) -> list[Path]:
    loading.resolved(directory)
    if not (files := parts(directory / RECORDING)):
        why = "it was flown with record.enabled=false, or cut short; `affinet render` and `report` need none"
        raise ScenarioError(f"{directory}: no {RECORDING} in it: {why}")
    return files


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)  # noqa: T201
