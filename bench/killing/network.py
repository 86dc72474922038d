"""Machines that share only an address: network namespaces on one bridge, whose links can be cut."""

from __future__ import annotations

import itertools
import os
import subprocess
from collections.abc import Sequence

_NUMBERS = itertools.count(1)


def _ip(*words: str) -> str:
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=True).stdout


def _port(name: str) -> str:
    return f"to-{name}"


class Network:
    """Some machines, called a, b, c ..., at 10.77.0.1, .2, .3 ...; a block has them made and removed."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names
        self._tag = f"aff{os.getpid()}x{next(_NUMBERS)}"
        self._bridge = f"{self._tag}-bridge"

    def __enter__(self) -> Network:
        try:
            self._set_up()
        except BaseException:
            self._tear_down()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._tear_down()

    def space(self, name: str) -> str:
        """The namespace that is this machine."""
        return f"{self._tag}-{name}"

    def address(self, name: str) -> str:
        """Where it is reached."""
        return f"10.77.0.{self.names.index(name) + 1}"

    def to(self, name: str) -> list[str]:
        """What stands before a command that is to run there."""
        return ["ip", "netns", "exec", self.space(name)]

    def cut(self, name: str) -> None:
        """Take a machine off the network."""
        _ip("-n", self._bridge, "link", "set", _port(name), "down")

    def mend(self, name: str) -> None:
        """Bring it back."""
        _ip("-n", self._bridge, "link", "set", _port(name), "up")

    def running(self, name: str) -> list[str]:
        """The processes that run there."""
        return _ip("netns", "pids", self.space(name)).split()

    def connections(self, name: str) -> list[str]:
        """The connections that a machine has to others, as its system knows them."""
        listed = subprocess.run([*self.to(name), "ss", "-Htn", "state", "established"], capture_output=True, check=True)
        return listed.stdout.decode().splitlines()

    def _set_up(self) -> None:
        self._add(self._bridge)
        _ip("-n", self._bridge, "link", "add", "br0", "type", "bridge")
        _ip("-n", self._bridge, "link", "set", "br0", "up")
        for name in self.names:
            self._add(self.space(name))
            peer = ("peer", "name", "eth0", "netns", self.space(name))
            _ip("-n", self._bridge, "link", "add", _port(name), "type", "veth", *peer)
            _ip("-n", self._bridge, "link", "set", _port(name), "master", "br0", "up")
            _ip("-n", self.space(name), "address", "add", f"{self.address(name)}/24", "dev", "eth0")
            _ip("-n", self.space(name), "link", "set", "eth0", "up")

    def _tear_down(self) -> None:
        """Remove them, as far as they are there."""
        for space in (*map(self.space, self.names), self._bridge):
            subprocess.run(["ip", "netns", "delete", space], capture_output=True, check=False)

    def _add(self, space: str) -> None:
        _ip("netns", "add", space)
        _ip("-n", space, "link", "set", "lo", "up")
