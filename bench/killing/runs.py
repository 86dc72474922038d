"""Runs whose processes are to be killed: on one machine, or over two that share a network and fly in real time."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import psutil
from killing.network import Network

from affinet.runtimes import nursery
from affinet.runtimes.forked import NURSERY
from netem.processes.wall_time import WallTime

COMMAND = "command"  # as a victim: one of those that hold seats on the other machine
HERE, THERE = "a", "b"
DT_S = 0.05  # a tick of a run over machines
_PATIENCE_S = 90.0
_LOOKS_S = 0.02
_PORT = 7447
_AGENTS_THERE = [4, 5, 6, 7]
_AFFINET = str(Path(sys.executable).parent / "affinet")
# Nobody is late but who is killed: a busy machine fails no run.
_REAL_TIME = ('time.mode="real"', f"time.dt={DT_S}", "time.real.late=20")


class Run:
    """A run in a directory of its own; none of its processes outlives the block."""

    def __init__(self, folder: Path, command: Sequence[str]) -> None:
        self._folder, self.out = folder, folder / "run"
        with (folder / "said").open("w") as said, (folder / "complained").open("w") as complained:
            # The run's temporary directory is in its processes' environment: that tells them from all others.
            environment = os.environ | {"TMPDIR": str(folder)}
            self.launcher = subprocess.Popen(
                [*command, "--json", "--out", str(self.out)], stdout=said, stderr=complained, env=environment
            )

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes():
            with suppress(psutil.NoSuchProcess):
                process.kill()
        self.launcher.wait()

    def processes(self) -> list[psutil.Process]:
        """All of this run that are alive, whoever is their parent by now, and on whichever machine."""
        return [process for process in psutil.process_iter() if self.owns(process)]

    def owns(self, process: psutil.Process) -> bool:
        """Whether it is of this run and alive: what only waits to be reaped has no environment any more."""
        return _environment(process).get("TMPDIR") == str(self._folder)

    def victim(self, name: str, draw: random.Random) -> psutil.Process:
        """The process of this name, as soon as it is there; of several, any."""
        found: list[psutil.Process] = []

        def there() -> bool:
            found[:] = self._called(name)
            return bool(found)

        await_true(there, f"there was no {name}")
        return draw.choice(sorted(found, key=lambda process: process.pid))

    def _called(self, name: str) -> list[psutil.Process]:
        launcher = psutil.Process(self.launcher.pid)
        if name == "launcher":
            return [launcher]
        commands = [child for child in _children(launcher) if "--connect" in _words(child)]
        if name == COMMAND:
            return commands
        nurseries = [one for of in (launcher, *commands) for one in _children(of) if nursery.__name__ in _words(one)]
        if name == NURSERY:
            return nurseries
        return [forked for one in nurseries for forked in _children(one) if name_of(forked) == name]

    def await_flight(self) -> float:
        """Wait until it is told to fly: when its first tick begins, by the monotonic clock, if it flies in real time."""
        await_true((self.out / "control.json").exists, "the run never got going")
        return WallTime.soon(1.0).began

    def text(self, name: str) -> str:
        """What was written to a file beside the run."""
        return (self._folder / name).read_text()


class Runs(Protocol):
    """Where runs are flown."""

    def flying(self, draw: random.Random) -> AbstractContextManager[Run]:
        """A run that has just been started, and its directory for as long as the block lasts."""


@dataclass(frozen=True)
class OnOneMachine:
    """Runs in lockstep, whose processes are all here."""

    scenario: str

    @contextmanager
    def flying(self, _draw: random.Random) -> Iterator[Run]:
        """A run that has just been started, and its directory for as long as the block lasts."""
        command = [sys.executable, "-m", "affinet", "run", self.scenario]
        with tempfile.TemporaryDirectory(prefix="kills-") as folder, Run(Path(folder), command) as run:
            yield run


@dataclass(frozen=True)
class OverNamespaces:
    """Runs in real time over two network namespaces: the medium is on the other one in half of them.

    Parameters
    ----------
    scenario
        What is flown.
    keys
        A folder with the certificates of all processes.
    """

    scenario: str
    keys: Path

    @contextmanager
    def flying(self, draw: random.Random) -> Iterator[Run]:
        """A run that has just been started, and its directory for as long as the block lasts."""
        medium_is_there = draw.random() < 0.5
        with tempfile.TemporaryDirectory(prefix="kills-") as made, Network((HERE, THERE)) as network:
            folder = Path(made)
            hosts = folder / "hosts.toml"
            hosts.write_text(self._hosts(network, medium_is_there))
            settings = [word for setting in _REAL_TIME for word in ("--set", setting)]
            command = [sys.executable, "-m", "affinet", "hosts", str(hosts), self.scenario, *settings]
            with Run(folder, [*network.to(HERE), *command]) as run:
                yield run

    def _hosts(self, network: Network, medium_is_there: bool) -> str:
        here, there = (f"tls/{network.address(name)}" for name in (HERE, THERE))
        machine = {"name": THERE, "command": network.to(THERE), "affinet": _AFFINET, "agents": _AGENTS_THERE}
        if medium_is_there:
            machine["netem"] = f"{there}:{_PORT}"
        lines = [f'listen = "{here}:{_PORT}"', f"keys = {json.dumps(str(self.keys))}", "[[machines]]"]
        return "\n".join([*lines, *(f"{key} = {json.dumps(value)}" for key, value in machine.items())])


@contextmanager
def over_namespaces(scenario: str) -> Iterator[OverNamespaces]:
    """Runs over namespaces, and their certificates for as long as the block lasts."""
    with tempfile.TemporaryDirectory(prefix="kills-") as folder:
        keys = Path(folder) / "keys"
        addresses = [Network((HERE, THERE)).address(name) for name in (HERE, THERE)]
        subprocess.run(
            [_AFFINET, "keys", str(keys), "--agents", "7", "--hub", *addresses], check=True, capture_output=True
        )
        yield OverNamespaces(scenario, keys)


def name_of(process: psutil.Process) -> str:
    """What a process is called, "" once it has gone."""
    try:
        return str(process.name())
    except psutil.Error:
        return ""


def await_true(condition: Callable[[], bool], otherwise: str) -> None:
    """Go on once it holds; end the bench when it never does."""
    deadline = time.monotonic() + _PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise SystemExit(otherwise)
        time.sleep(_LOOKS_S)


def _environment(process: psutil.Process) -> dict[str, str]:
    try:
        return dict(process.environ())
    except (psutil.Error, OSError):
        return {}


def _children(process: psutil.Process) -> list[psutil.Process]:
    try:
        return list(process.children())
    except psutil.Error:
        return []


def _words(process: psutil.Process) -> list[str]:
    try:
        return list(process.cmdline())
    except psutil.Error:
        return []
