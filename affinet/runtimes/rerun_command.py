"""What the `rerun` command does for us: a viewer to watch a run in, and the mending of a recording cut short."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

_START_S = 10.0
_NOTHING_IN_IT, _MAY_BE_NOTHING = b"no data recording found", 1024  # bytes: a first chunk alone is longer


class NoViewer(RuntimeError):
    """The command is not there, or no viewer could be started: why."""


class NotMended(RuntimeError):
    """A recording that breaks off stays as it is: why."""


def mend(recording: Path) -> None:
    """Give a recording whose writer was killed the ending it lacks, so that every tool reads it.

    Where the writer had not come to say what it records there is nothing to read, and the file is removed.

    Raises
    ------
    NotMended
        When it cannot be mended.
    """
    recording = recording.absolute()  # a name that begins with a dash is no option
    mended = recording.with_suffix(".mended.rrd")
    merged = _rrd("merge", "-o", str(mended), str(recording))
    if merged.returncode:
        mended.unlink(missing_ok=True)
        raise NotMended(f"{recording} breaks off, and cannot be mended: {_last_line(merged.stderr)}")
    mended.replace(recording)
    # A run that failed is to end soon: the command takes a tenth of the time in which its library is imported, on a busy
    # machine seconds.
    if recording.stat().st_size < _MAY_BE_NOTHING and _is_empty(recording):
        recording.unlink()


def open_viewer() -> str:
    """Start a viewer on loopback that outlives the run, and return the URL to stream to.

    Raises
    ------
    NoViewer
        When it cannot start, as on a machine without a screen.
    """
    port = _free_port()
    viewer = subprocess.Popen(
        [_command(), "--bind", "127.0.0.1", "--port", str(port), "--expect-data-soon"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    deadline = time.monotonic() + _START_S
    while not _listens(port):
        if viewer.poll() is not None:
            why = _last_line(viewer.communicate()[1])
            raise NoViewer(f"the Rerun viewer ended at once: {why}; fly without --view, and open run.rrd later")
        if time.monotonic() > deadline:
            viewer.terminate()
            raise NoViewer(f"the Rerun viewer did not listen within {_START_S:g} s")
    return f"rerun+http://127.0.0.1:{port}/proxy"


def _is_empty(recording: Path) -> bool:
    return _NOTHING_IN_IT in _rrd("compare", str(recording), str(recording)).stderr


def _command() -> str:
    beside = Path(sys.executable).with_name("rerun")
    command = str(beside) if beside.exists() else shutil.which("rerun")
    if command is None:
        raise NoViewer("the `rerun` command of the rerun-sdk package is not on the path; fly without --view")
    return command


def _rrd(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    command = [_command(), "rrd", *arguments]
    return subprocess.run(command, check=False, stdin=subprocess.DEVNULL, capture_output=True)


def _last_line(told: bytes) -> str:
    lines = told.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "it did not say why"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex(("127.0.0.1", port)) == 0
