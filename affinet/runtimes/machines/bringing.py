"""Tables that a process writes on another machine, brought here while they grow.

So what is lost is the last second of them, whichever machine dies, and not all of what was written there.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from affinet.runtimes.machines import joining
from affinet.runtimes.machines.coordinator import Coordinator
from affinet.runtimes.machines.joining import Asked, Listing, Part
from netem.processes import system_errors
from netem.wire.carrier import NotCarried
from netem.wire.wrong import WireError

_EVERY_S, _ANSWERED_WITHIN_S = 0.25, 1.0
_Ask = Callable[[Asked], bytes]


class Bringing:
    """Brings them from its start on, until it is finished.

    Parameters
    ----------
    coordinator, name
        Who knows where the process is, and what it is called; nothing is brought of one that is here.
    to
        The folder to bring them to.
    """

    def __init__(self, coordinator: Coordinator, name: str, to: Path) -> None:
        self._coordinator, self._name, self._to = coordinator, name, to
        self._had: Counter[Path] = Counter()  # bytes of each
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def start(self) -> None:
        """Bring from now on, in a thread, what there is."""
        self._thread.start()

    def finish(self, *, patiently: bool) -> None:
        """Bring what is left; whoever wrote it has ended.

        Parameters
        ----------
        patiently
            Whether to wait for a link that is cut; where the run has failed already, nobody does.

        Raises
        ------
        RunFailed
            When its machine does not answer, and was waited for.
        OSError
            When it cannot be written here.
        """
        self._over.set()
        self._thread.join()
        if not self._is_elsewhere:
            return
        if patiently:
            self._bring(lambda what: self._coordinator.asked_for(self._name, what))
            return
        with suppress(NotCarried):
            self._bring(self._ask)

    @property
    def _is_elsewhere(self) -> bool:
        """Whether it has been started on another machine."""
        seat = self._coordinator.seats.get(self._name)
        return seat is not None and seat.process is not None

    def _follow(self) -> None:
        while not self._over.wait(_EVERY_S):
            with suppress(NotCarried, WireError, OSError):  # tried again, and told at the end
                if self._is_elsewhere:
                    self._bring(self._ask)

    def _ask(self, what: Asked) -> bytes:
        return self._coordinator.ask(self._name, what, _ANSWERED_WITHIN_S)

    def _bring(self, ask: _Ask) -> None:
        listed: dict[str, int] = joining.unpack(dict[str, int], ask(Listing(ending=joining.TABLE)))
        for name, size in listed.items():
            path = self._to / Path(name).name
            while self._had[path] < size and (part := ask(Part(name=name, start=self._had[path]))):
                self._keep(path, part)

    def _keep(self, path: Path, part: bytes) -> None:
        start = self._had[path]
        with system_errors.about(path), path.open("r+b" if start else "wb") as file:
            file.seek(start)
            file.write(part)
        self._had[path] += len(part)
