"""Commands on machines, as somebody types them, and what becomes of them."""

import os
import subprocess
import sys
import uuid
from contextlib import suppress
from datetime import timedelta
from pathlib import Path

import psutil
from awaiting import PATIENCE

from netem.wire import authority
from netem.wire.session import CENTRE, CONTROL, COORDINATOR, HUB, WORLD, agent_name, host_name

AFFINET = str(Path(sys.executable).parent / "affinet")
_MARK = "AFFINET_FLEET"


def keys_in(folder, agents, *addresses):
    """Certificates for a swarm."""
    names = [
        COORDINATOR,
        HUB,
        WORLD,
        CENTRE,
        CONTROL,
        *map(agent_name, range(1, agents + 1)),
        *map(host_name, (1, 2, 3)),
    ]
    authority.make(folder, names, addresses, timedelta(days=1))
    return folder


class Fleet:
    """Commands of one run; leaving the block leaves none of them."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._mark = uuid.uuid4().hex
        self.commands = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.running():
            with suppress(psutil.NoSuchProcess):
                process.kill()
        for command in self.commands:
            command.wait(PATIENCE)

    def start(self, *words, to=()):
        """Type a command on a machine."""
        said = self._folder / f"said-{len(self.commands)}"
        with said.open("wb") as file:
            command = subprocess.Popen(
                [*to, AFFINET, *map(str, words)],
                stdout=file,
                stderr=file,
                cwd=self._folder,
                env=os.environ | {_MARK: self._mark},
            )
        command.said = said
        self.commands.append(command)
        return command

    def running(self):
        """All processes of the run, whoever started them and wherever they are."""
        found = []
        for process in psutil.process_iter():
            with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
                if process.environ().get(_MARK) == self._mark and process.status() != psutil.STATUS_ZOMBIE:
                    found.append(process)
        return found


def ended(command):
    """The exit status of a command, and what it said."""
    status = command.wait(PATIENCE)
    return status, command.said.read_text()
