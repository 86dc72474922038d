"""Machines that share only an address: network namespaces on one bridge, whose links can be cut."""

import itertools
import os
import shutil
import subprocess
from contextlib import contextmanager
from functools import cache

import pytest

_NUMBERS = itertools.count(1)


def _ip(*words):
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=True).stdout


def _port(name):
    return f"to-{name}"


class Network:
    """Some machines, called a, b, c ..., at 10.77.0.1, .2, .3 ..."""

    def __init__(self, names):
        self.names = names
        self._tag = f"aff{os.getpid()}x{next(_NUMBERS)}"
        self._bridge = f"{self._tag}-bridge"

    def set_up(self):
        """Make them."""
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

    def tear_down(self):
        """Remove them, as far as they are there."""
        for space in (*map(self.space, self.names), self._bridge):
            subprocess.run(["ip", "netns", "delete", space], capture_output=True, check=False)

    def space(self, name):
        """The namespace that is this machine."""
        return f"{self._tag}-{name}"

    def address(self, name):
        """Where it is reached."""
        return f"10.77.0.{self.names.index(name) + 1}"

    def to(self, name):
        """What stands before a command that is to run there."""
        return ["ip", "netns", "exec", self.space(name)]

    def cut(self, name):
        """Take a machine off the network."""
        _ip("-n", self._bridge, "link", "set", _port(name), "down")

    def mend(self, name):
        """Bring it back."""
        _ip("-n", self._bridge, "link", "set", _port(name), "up")

    def running(self, name):
        """The processes that run there."""
        return _ip("netns", "pids", self.space(name)).split()

    def connections(self, name):
        """The connections that a machine has to others, as its system knows them."""
        listed = subprocess.run([*self.to(name), "ss", "-Htn", "state", "established"], capture_output=True, check=True)
        return listed.stdout.decode().splitlines()

    def _add(self, space):
        _ip("netns", "add", space)
        _ip("-n", space, "link", "set", "lo", "up")


@contextmanager
def network(*names):
    """A network of machines; the test is skipped where there can be none."""
    if (why := _why_not()) is not None:
        pytest.skip(f"no network namespaces here: {why}")
    machines = Network(names)
    try:
        machines.set_up()
        yield machines
    finally:
        machines.tear_down()


@cache
def _why_not():
    if not shutil.which("ip") or not shutil.which("ss"):
        return "ip and ss are not installed (iproute2)"
    tried = Network(("a",))
    try:
        tried.set_up()
    except subprocess.CalledProcessError as error:
        return error.stderr.strip() or str(error)
    finally:
        tried.tear_down()
    return None
