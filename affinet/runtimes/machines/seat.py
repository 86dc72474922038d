"""A seat, as the coordinator has it: who has taken it, what runs there, and whether its machine is there."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from pathlib import Path

from affinet.runtimes.machines import joining
from affinet.runtimes.machines.joining import Alive, Down, Failed, Joining, Up
from affinet.runtimes.machines.remote import RemoteProcess
from netem.processes.supervised import BEAT_S
from netem.wire.carrier import Voice

SILENT_S = 3 * BEAT_S  # then a machine is cut off


@dataclass
class Seat:
    """The place of a process on another machine.

    Attributes
    ----------
    name
        Under which it logs in.
    called
        What its machine is called here; None for what it calls itself.
    joined
        What its machine joined with; None before it has.
    process, started
        The one that runs there, or ran last, and how many there were.
    failed
        Why the machine can start nothing any more.
    is_here
        Whether its session is there.
    silent_s, gone_s
        For how long it has said nothing, and its session has been away, while somebody looked.
    was_closed
        Whether its session was closed, and not cut.
    """

    name: str
    voice: Voice
    called: str | None = None
    joined: Joining | None = None
    process: RemoteProcess | None = None
    failed: str | None = None
    started: int = 0
    silent_s: float = 0.0
    gone_s: float = 0.0
    was_closed: bool = False
    is_here: bool = False
    _heard: threading.Event = field(default_factory=threading.Event)

    @property
    def machine(self) -> str | None:
        """What its machine is called, once it has joined."""
        return None if self.joined is None else self.called or self.joined.machine

    @property
    def where(self) -> str:
        """For people."""
        return f"{self.name.replace('-', ' ')} on {self.machine}" if self.joined else self.name

    @property
    def folder(self) -> Path:
        """A directory of its own over there."""
        assert self.joined is not None, "it has joined"
        return Path(self.joined.folder)

    def say(self, message: Down) -> None:
        """Tell its machine."""
        self.voice.say(joining.pack(message))

    def vacate(self) -> None:
        """It can be taken again."""
        self.joined, self.was_closed = None, False
        self.silent_s = self.gone_s = 0.0

    def lives(self, data: bytes) -> None:
        """Its machine says so."""
        self._heard.set()
        alive = joining.unpack(Alive, data)
        if self.process is not None and alive.number == self.started:
            self.process.lives(alive)

    def take(self, data: bytes) -> None:
        """Its machine tells of its processes."""
        message = joining.unpack(Up, data)
        if isinstance(message, Failed):
            self.failed = message.why
        if self.process is not None and (isinstance(message, Failed) or message.number == self.started):
            self.process.take(message)

    def looked_at(self, since_s: float) -> None:
        """Count how long it has been silent, while somebody looked for so many seconds more."""
        if self._heard.is_set():
            self._heard.clear()
            self.silent_s = 0.0
        else:
            self.silent_s += since_s
        if self.is_here:
            self.gone_s, self.was_closed = 0.0, False
            return
        # A cut link goes silent first; a session that goes before was closed, since its process has died.
        self.was_closed = self.was_closed or (self.gone_s == 0.0 and self.silent_s < SILENT_S)
        self.gone_s += since_s
