"""Watching: a window or a page, live and later, one run or several; without a screen a run flies all the same."""

import json
import os
import signal
import socket
import stat
import subprocess
import sys
import urllib.request
from collections import Counter
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import psutil
import pytest
from flying import plan_of
from recorded import chunks_of, column, rows
from rerun import escape_entity_path_part
from rerun.chunk import RrdReader

from affinet.cli import watching
from affinet.cli.commands import main
from affinet.runtimes import viewers
from affinet.runtimes.run import fly
from affinet.runtimes.viewers import WebViewer
from affinet.scenario.names import apart
from netem.core.parts import parts

SHORT = ("time.dt=0.05", "time.duration=0.5")
RUN = ["run", "corridor", "--set", "time.dt=0.05", "--duration", "0.5", "--runtime", "inprocess"]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs of a name, and one of another task."""
    folder = tmp_path_factory.mktemp("runs")
    for out, name, *overrides in (
        ("a/night run", "corridor"),
        ("b/night run", "corridor", "agents.estimator=rkf"),
        ("places", "localization"),
    ):
        fly(plan_of(name, *SHORT, *overrides), "inprocess", folder / out, lambda *_: None)
    return folder


@pytest.fixture
def viewer(tmp_path, monkeypatch):
    """A viewer that is a script: what it was called with is in a file."""

    def install(script):
        program, told = tmp_path / "viewer", tmp_path / "told"
        program.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" > {told}\n{script}\n')
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setattr(viewers, "command", lambda: str(program))
        return told

    return install


def changing(file):
    """How many rows there are of each entity that changes, of all that is no property."""
    return Counter({path: number for path, number in rows(file)[0].items() if not path.startswith("/__")})


def test_one_run_is_shown_as_it_was_recorded(runs, viewer):
    told = viewer("exit 0")
    assert main(["watch", str(runs / "places")]) == 0
    words = told.read_text().splitlines()
    assert words[:2] == ["--bind", "127.0.0.1"]
    assert words[-1:] == [str(runs / "places" / "run.rrd")]


def test_several_runs_are_one_recording_with_a_part_for_each(runs, tmp_path, monkeypatch):
    kept = tmp_path / "together.rrd"
    monkeypatch.setattr(watching, "show", lambda files: kept.write_bytes(files[0].read_bytes()))
    assert main(["watch", str(runs / "a" / "night run"), str(runs / "b" / "night run"), str(runs / "places")]) == 0
    names = {"night run (1)": "a/night run", "night run (2)": "b/night run", "places": "places"}
    expected = Counter()
    for name, out in names.items():
        for path, number in changing(runs / out / "run.rrd").items():
            expected[f"/{escape_entity_path_part(name)}{path}"] = number
    assert changing(kept) == expected
    paths = [f"/{escape_entity_path_part(name)}/metrics/tracking_error" for name in names]
    named = [column(chunks_of(kept), path, "SeriesLines:names", static=True)[-1:] for path in paths]
    assert named == [[["night run (1)"]], [["night run (2)"]], []]
    assert RrdReader(str(kept)).blueprints()


def test_no_temporary_file_is_left(runs, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(watching.tempfile, "tempdir", None)
    seen = []
    monkeypatch.setattr(watching, "show", seen.extend)
    main(["watch", str(runs / "places"), str(runs / "a" / "night run")])
    assert seen[0].parent.parent == tmp_path
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("made", "line"),
    [
        (False, "nowhere"),
        (True, "no run.rrd in it: it was flown with record.enabled=false, or cut short; `affinet render`"),
    ],
)
def test_what_cannot_be_watched_is_refused(made, line, tmp_path, capsys):
    out = tmp_path / "nowhere"
    if made:
        fly(plan_of("corridor", *SHORT, "record.enabled=false"), "inprocess", out, lambda *_: None)
    assert main(["watch", str(out)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert line in said


def test_where_in_its_source_a_viewer_failed_is_not_told(runs, viewer, capsys):
    viewer("echo 'Error: os error at /usr/registry/winit-0.30/src/mod.rs:765: DISPLAY is not set.' >&2; exit 1")
    assert main(["watch", str(runs / "places")]) == 2
    assert "ended: Error: os error: DISPLAY is not set; --serve" in capsys.readouterr().err


def test_a_viewer_that_fails_is_told(runs, viewer, capsys):
    viewer("echo no display >&2; exit 1")
    assert main(["watch", str(runs / "places")]) == 2
    assert "the Rerun viewer ended: no display" in capsys.readouterr().err


def test_without_a_screen_a_run_flies_and_says_once_how_to_watch_it(viewer, tmp_path, capsys):
    viewer("echo no display >&2; exit 1")
    out = tmp_path / "run"
    assert main([*RUN, "--view", "--out", str(out)]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "viewer" in line]
    assert said == [
        "the Rerun viewer ended at once: no display; it flies without: `affinet watch RUN` shows it later, "
        "--serve in a browser"
    ]
    assert json.loads((out / "summary.json").read_text())["verdict"] == "pass"


def ports(page):
    """Of the page, and of the stream that it shows."""
    address = urlsplit(page)
    (stream,) = parse_qs(address.query)["url"]
    return address.port, urlsplit(stream).port


def listens(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_a_page_is_served_on_loopback_alone_for_as_long_as_the_block_lasts(runs):
    with WebViewer(parts(runs / "places" / "run.rrd")) as web:
        assert b"<html" in urllib.request.urlopen(web.page.partition("?")[0]).read().lower()
        assert all(map(listens, ports(web.page)))
        mine = {
            one.laddr.ip
            for child in psutil.Process().children(recursive=True)
            for one in child.net_connections("tcp")
            if one.status == psutil.CONN_LISTEN and one.laddr.port in ports(web.page)
        }
        assert mine == {"127.0.0.1"}
    assert not any(map(listens, ports(web.page)))


SERVES = """import sys
from affinet.runtimes.viewers import WebViewer
from affinet.scenario.names import apart
with WebViewer() as web:
    print(web.page, flush=True)
    sys.stdin.read()"""


def test_a_server_does_not_outlive_who_started_it():
    with subprocess.Popen([sys.executable, "-c", SERVES], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as owner:
        page = owner.stdout.readline().decode().strip()
        (server,) = psutil.Process(owner.pid).children(recursive=True)
        assert all(map(listens, ports(page)))
        owner.kill()
        owner.wait()
    gone, _ = psutil.wait_procs([server], timeout=30.0)
    assert gone


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_a_run_is_served_while_it_flies_and_on_until_a_signal_and_keeps_its_status(number, tmp_path):
    command = [sys.executable, "-m", "affinet", *RUN, "--serve", "--json", "--out", str(tmp_path / "run")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as flying:
        told = [flying.stderr.readline().decode()]
        page = told[0].strip()
        assert page.startswith("http://127.0.0.1:")
        assert json.loads(flying.stdout.readline())["verdict"] == "pass"
        while "until Ctrl-C" not in told[-1]:
            told.append(flying.stderr.readline().decode())
        assert all(map(listens, ports(page)))
        os.kill(flying.pid, number)
        assert flying.wait() == 0
    assert not any(map(listens, ports(page)))


@pytest.mark.parametrize(
    ("directories", "names"),
    [(["a/x", "b/y"], ["x", "y"]), (["a/x", "b/x", "y"], ["x (1)", "x (2)", "y"])],
)
def test_each_run_has_a_name_of_its_own(directories, names):
    assert apart([Path(one) for one in directories]) == names
