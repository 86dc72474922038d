"""A run that is spread over machines: who logs in where, and where files of its processes lie."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType

from affinet.runtimes.machines.bringing import Bringing
from affinet.runtimes.machines.commands import Commands
from affinet.runtimes.machines.coordinator import Coordinator
from netem.processes.system_errors import afterwards
from netem.wire.session import HUB, Login


class Spread:
    """The other machines, as the launcher needs them; leaving the block brings what lies on them, and lets them go.

    Parameters
    ----------
    coordinator
        To whom they come.
    groups
        Agents that are on one machine, for each.
    commands
        What is started to have them come, if not by hand.
    listen
        Where the medium listens, if it is on this machine.
    keys
        The folder with this machine's certificates.
    out
        The run directory.
    """

    def __init__(
        self,
        coordinator: Coordinator,
        groups: Sequence[Collection[int]],
        commands: Commands,
        listen: str,
        keys: str,
        out: Path,
    ) -> None:
        self.coordinator, self.groups, self._commands = coordinator, groups, commands
        coordinator.heed_too = commands.heed
        self._listen, self._keys = listen, keys
        self._bringing = Bringing(coordinator, HUB, out)
        self._stack = ExitStack()

    def __enter__(self) -> Spread:
        self._stack.push(self._commands.__exit__)  # they are waited for once they were told to leave
        self._stack.enter_context(self.coordinator)
        self._commands.__enter__()
        self._bringing.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._stack, afterwards(partial(self._bringing.finish, patiently=error is None)):
            if error is not None:
                raise error

    def logins(self, names: Iterable[str]) -> dict[str, Login]:
        """How each process logs in, once all machines have joined: where the medium listens, by a certificate of its own."""
        medium = self.coordinator.seats.get(HUB)
        listens = medium.joined.listens if medium is not None and medium.joined is not None else None
        return {name: Login(listens or self._listen, name, keys=self._keys_of(name)) for name in names}

    def folder(self, name: str, here: Path) -> Path:
        """Where a process writes what it writes: on its own machine, or here."""
        seat = self.coordinator.seats.get(name)
        return here if seat is None else seat.folder

    def report(self, name: str) -> dict[str, float]:
        """How much the medium's clock shows more than that of a process, for the summary."""
        clock = self.coordinator.clock(name)
        return {"clock_offset_s": clock.offset_s, "clock_uncertainty_s": clock.uncertainty_s}

    def _keys_of(self, name: str) -> str:
        seat = self.coordinator.seats.get(name)
        return self._keys if seat is None or seat.joined is None else seat.joined.keys
