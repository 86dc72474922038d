"""Whether all is there that affinet needs of a machine: what is missing, and the way out."""

from __future__ import annotations

import os
import platform
import resource
import shutil
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import psutil

from affinet.planning import making
from affinet.runtimes.private import socket_folder
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.rerun_command import NoViewer, command
from affinet.runtimes.run import fly
from affinet.scenario import loading
from analysis.kernels import kept
from analysis.models.finding import Finding
from netem.processes.system_errors import said

_PACKAGES = ("affinet", "numpy", "numba", "eclipse-zenoh", "msgpack", "pydantic", "pyarrow", "rerun-sdk")
_FEW_DESCRIPTORS, _DESCRIPTORS = 64, 1024  # of the launcher, five for each process and some
_LITTLE_MEMORY, _MEMORY = 200 << 20, 1 << 30  # bytes
_SHORT = ("time.duration=0.2", "record.enabled=false")


def findings() -> Iterator[Finding]:
    """What was looked at, one after the other; "error" where affinet cannot do without."""
    for check, look in _LOOKS.items():
        try:
            yield look(check)
        except OSError as error:
            yield Finding(check, "error", said(error))


def _versions(check: str) -> Finding:
    found, missing = [f"python {platform.python_version()}"], list[str]()
    for package in _PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            missing.append(package)
    if missing:
        return Finding(
            check, "error", f"{', '.join(missing)} not installed; install affinet again: pip install affinet"
        )
    return Finding(check, "ok", ", ".join(found))


def _unix_sockets(check: str) -> Finding:
    folder = socket_folder()
    with tempfile.TemporaryDirectory(prefix="affinet-", dir=folder) as place, socket.socket(socket.AF_UNIX) as bound:
        bound.bind(f"{place}/z.sock")
    own = tempfile.gettempdir()
    if folder != own:
        return Finding(
            check, "note", f"{own} is too long or too odd a path for them; runs take {folder} (TMPDIR sets another)"
        )
    return Finding(check, "ok", f"can be bound in {folder}")


def _loopback(check: str) -> Finding:
    try:
        with socket.socket() as bound:
            bound.bind(("127.0.0.1", 0))
            bound.listen()
    except OSError as error:
        return Finding(check, "note", f"{said(error)}; the viewer (--view), and runs over several machines, need it")
    return Finding(check, "ok", "TCP can be bound on 127.0.0.1")


def _descriptors(check: str) -> Finding:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = "any number" if hard == resource.RLIM_INFINITY else f"{hard}"
    if soft != resource.RLIM_INFINITY and soft < _FEW_DESCRIPTORS:
        return Finding(
            check, "error", f"{soft} files may be open at once, too few for a swarm; `ulimit -n {_DESCRIPTORS}`"
        )
    if soft != resource.RLIM_INFINITY and soft < _DESCRIPTORS:
        return Finding(
            check, "note", f"{soft} files may be open at once; large swarms want more: `ulimit -n` takes {most}"
        )
    return Finding(check, "ok", f"{soft} files may be open at once, {most} if asked for")


def _cores(check: str) -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if cores == 1:
        return Finding(check, "note", "one: runs over processes take turns on it; `--runtime inprocess` is as good")
    return Finding(check, "ok", f"{cores} for this process, {os.cpu_count()} in all; {platform.machine()}")


def _memory(check: str) -> Finding:
    memory = psutil.virtual_memory()
    has = f"{memory.available >> 20} of {memory.total >> 20} MB are free"
    if memory.available < _LITTLE_MEMORY:
        return Finding(check, "error", f"{has}; a run wants {_LITTLE_MEMORY >> 20} MB: end other programs")
    return Finding(check, "ok" if memory.available >= _MEMORY else "note", has)


def _room(check: str) -> Finding:
    here = Path.cwd()
    if not os.access(here, os.W_OK | os.X_OK):
        return Finding(check, "note", f"{here} cannot be written to; name a place for each run with --out")
    return Finding(check, "ok", f"{shutil.disk_usage(here).free >> 20} MB are free in {here}")


def _kernels(check: str) -> Finding:
    folder = kept.folder()
    above = next(path for path in (folder, *folder.parents) if path.exists())
    if not (above.is_dir() and os.access(above, os.W_OK | os.X_OK)):
        return Finding(
            check, "note", f"{folder} cannot be written to: kernels are compiled in every run; set XDG_CACHE_HOME"
        )
    number = len(list(folder.glob("*.o"))) if folder.exists() else 0
    return Finding(check, "ok", f"{number} are kept in {folder}; others are compiled when they are first called")


def _viewer(check: str) -> Finding:
    try:
        viewer = command()
    except NoViewer as error:
        return Finding(check, "note", f"{error}; recordings are written all the same")
    if sys.platform == "linux" and not any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")):
        return Finding(check, "note", "no display: `--serve` shows a run in a browser, in place of --view")
    return Finding(check, "ok", f"a display is there, and {viewer}")


def _self_test(check: str) -> Finding:
    plan = making.make(loading.load("corridor", _SHORT))
    with tempfile.TemporaryDirectory(prefix="affinet-doctor-") as folder:
        flown = fly(plan, "processes", Path(folder) / "run", lambda *_: None)
    if flown.verdict != "pass":
        return Finding(
            check, "error", f"a short flight over processes came to {flown.verdict}: {'; '.join(flown.reasons)}"
        )
    if flown.digest != rehearse(plan).outcome.digest:
        return Finding(
            check, "error", "a flight over processes has other bits than the same in process; please report it"
        )
    return Finding(
        check, "ok", f"{flown.ticks} ticks over {len(flown.processes)} processes, and in this one: the same bits"
    )


_LOOKS: dict[str, Callable[[str], Finding]] = {
    "versions": _versions,
    "unix sockets": _unix_sockets,
    "loopback": _loopback,
    "descriptors": _descriptors,
    "cores": _cores,
    "memory": _memory,
    "working directory": _room,
    "kernels": _kernels,
    "viewer": _viewer,
    "self-test": _self_test,
}
