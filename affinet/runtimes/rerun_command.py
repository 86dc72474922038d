"""What the `rerun` command does for us: the mending of a recording cut short. `viewers.py` watches by it."""

from __future__ import annotations

import subprocess
from importlib.util import find_spec
from pathlib import Path

from netem.core.refusal import Refusal

_NOTHING_IN_IT, _MAY_BE_NOTHING = b"no data recording found", 1024  # bytes: a first chunk alone is longer


class NoViewer(Refusal, RuntimeError):
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
        raise NotMended(f"{recording} breaks off, and cannot be mended: {last_line(merged.stderr)}")
    mended.replace(recording)
    # A run that failed is to end soon: the command takes a tenth of the time in which its library is imported, on a busy
    # machine seconds.
    if recording.stat().st_size < _MAY_BE_NOTHING and _is_empty(recording):
        recording.unlink()


def _is_empty(recording: Path) -> bool:
    return _NOTHING_IN_IT in _rrd("compare", str(recording), str(recording)).stderr


def command() -> str:
    """The command.

    Raises
    ------
    NoViewer
        When there is none.
    """
    # What lies on the path is a program in Python that starts this one, and would outlive it.
    package = find_spec("rerun_cli")
    places = [] if package is None else list(package.submodule_search_locations or ())
    found = next((program for place in places if (program := Path(place) / "rerun").exists()), None)
    if found is None:
        raise NoViewer("the `rerun` command of the rerun-sdk package is not there: install rerun-sdk again")
    return str(found)


def _rrd(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    words = [command(), "rrd", *arguments]
    return subprocess.run(words, check=False, stdin=subprocess.DEVNULL, capture_output=True)


def last_line(told: bytes) -> str:
    """The last line of what it said."""
    lines = told.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "it did not say why"
