"""`affinet doctor`: what it looks at, and what it says where something is missing."""

import json
import resource
import socket
import tempfile
from importlib.metadata import PackageNotFoundError
from types import SimpleNamespace

import pytest
from flying import PROCESSES

from affinet.cli.commands import main
from affinet.runtimes import health, rerun_command

pytestmark = PROCESSES


def found():
    return {finding.check: finding for finding in health.findings()}


def look(check):
    return health._LOOKS[check](check)


def test_it_flies_a_short_run_twice_and_finds_the_same_bits(capsys):
    assert main(["doctor", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["healthy"] is True
    levels = {finding["check"]: finding["level"] for finding in said["findings"]}
    assert list(levels) == [
        *("versions", "unix sockets", "loopback", "descriptors", "cores", "memory", "working directory", "kernels"),
        *("viewer", "self-test"),
    ]
    assert said["findings"][-1]["says"] == "20 ticks over 10 processes, and in this one: the same bits"
    assert "affinet 0.1.0" in said["findings"][0]["says"]


@pytest.fixture
def short(monkeypatch):
    """Without the self-test."""
    monkeypatch.setattr(health, "_LOOKS", {name: look for name, look in health._LOOKS.items() if name != "self-test"})


def missing(package):
    raise PackageNotFoundError(package)


def limited(soft, hard):
    return lambda _: (soft, hard)


class NoUnix(socket.socket):
    def bind(self, _):
        raise PermissionError(1, "Operation not permitted", None)


MEMORY = SimpleNamespace(available=100 << 20, total=8 << 30)


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(
    ("check", "planted", "says"),
    [
        ("versions", ("version", missing), "affinet, numpy, numba, eclipse-zenoh, "),
        ("unix sockets", ("socket.socket", NoUnix), "Operation not permitted"),
        (
            "descriptors",
            ("resource.getrlimit", limited(32, 32)),
            "32 files may be open at once, too few for a swarm; `ulimit -n 1024`",
        ),
        (
            "memory",
            ("psutil.virtual_memory", lambda: MEMORY),
            "100 of 8192 MB are free; a run wants 200 MB: end other programs",
        ),
    ],
)
def test_what_is_missing_is_said_and_fails(check, planted, says, monkeypatch, capsys):
    monkeypatch.setattr(f"{health.__name__}.{planted[0]}", planted[1])
    assert main(["doctor", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["healthy"] is False
    (wrong,) = [finding for finding in said["findings"] if finding["level"] == "error"]
    assert wrong["check"] == check
    assert wrong["says"].startswith(says)


def test_a_temporary_folder_that_is_too_long_is_said(tmp_path, monkeypatch):
    long = tmp_path / ("x" * 120)
    long.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(long))
    finding = look("unix sockets")
    assert finding.level == "note"
    assert finding.says.startswith(f"{long} is too long or too odd a path for them; runs take /tmp")


def test_few_descriptors_are_a_note(monkeypatch):
    monkeypatch.setattr(resource, "getrlimit", limited(256, 4096))
    assert look("descriptors").says == "256 files may be open at once; large swarms want more: `ulimit -n` takes 4096"


def test_no_display_is_a_note_with_the_way_out(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert look("viewer").says == "no display: `--serve` shows a run in a browser, in place of --view"


def test_the_viewer_is_that_which_commands_start_whatever_lies_on_the_path(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setenv("PATH", "")
    found = look("viewer")
    assert (found.level, found.says) == ("ok", f"a display is there, and {rerun_command.command()}")
    monkeypatch.setattr(rerun_command, "find_spec", lambda _: None)
    found = look("viewer")
    assert (found.level, found.says.partition(":")[0]) == (
        "note",
        "the `rerun` command of the rerun-sdk package is not there",
    )


def test_a_self_test_that_fails_or_differs_is_said(monkeypatch):
    flown = SimpleNamespace(verdict="fail", reasons=["agent-1 ended"], digest="0", ticks=20, processes=())
    monkeypatch.setattr(health, "fly", lambda *_: flown)
    assert look("self-test").says == "a short flight over processes came to fail: agent-1 ended"
    flown.verdict = "pass"
    finding = look("self-test")
    assert (finding.level, finding.says.partition(";")[0]) == (
        "error",
        "a flight over processes has other bits than the same in process",
    )


def test_whatever_a_look_meets_is_said(monkeypatch):
    def refused(_):
        raise OSError(28, "No space left on device", "/tmp/x")

    monkeypatch.setattr(health, "_LOOKS", {"room": refused})
    assert found()["room"].level == "error"
    assert "No space left on device" in found()["room"].says
