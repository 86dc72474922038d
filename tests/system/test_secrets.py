"""Passwords of a run: where they stand while it flies, and that they are gone after every kind of end."""

import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from awaiting import PATIENCE, await_true
from flying import PROCESSES, plan_of

from affinet.runtimes.launcher import Launcher
from affinet.runtimes.private import private_folder

pytestmark = PROCESSES

RUN = [sys.executable, "-m", "affinet", "run", "corridor", "--estimator", "none", "--set", "record.enabled=false"]


@pytest.fixture
def private(tmp_path, monkeypatch):
    """The temporary folder of the runs of a test."""
    folder = tmp_path / "t"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


# ---- while it flies


def seen(secrets, pids, folders):
    """Where one of them stands: in what `ps` shows of a process, in its environment, in files; and who may read those."""
    files = [file for folder in folders for file in folder.rglob("*") if file.is_file()]
    files += [Path(f"/proc/{pid}/{name}") for pid in pids for name in ("cmdline", "environ")]
    hits = set()
    for file in files:
        with suppress(FileNotFoundError, ProcessLookupError):  # it has gone meanwhile
            content = file.read_bytes()
            if any(secret.encode() in content for secret in secrets):
                hits.add((file.name, stat.S_IMODE(file.stat().st_mode)))
    return hits


def test_passwords_stand_in_one_file_that_nobody_else_reads(out, private):
    found, modes = [], set()

    class Watched(Launcher):
        def _start_agent(self, *given):  # what an agent loads could look around before the first tick
            look()
            return super()._start_agent(*given)

    def look(*_):
        pids = [os.getpid(), *(child.pid for child in psutil.Process().children(recursive=True))]
        passwords = [login.password for login in launcher._logins.values()]
        found.append(seen(passwords, pids, [out, private]))
        modes.update((path.name, stat.S_IMODE(path.stat().st_mode)) for path in private.iterdir())

    out.mkdir()
    launcher = Watched(plan_of("corridor", "time.duration=2"), out, watch=look)
    before = os.umask(0)
    try:
        assert launcher.fly().failure is None
    finally:
        os.umask(before)
    assert len(launcher._logins) == 7 + 5
    # Once in the private folder, once as the link to it in the run directory.
    assert not set.union(*found[:7])
    assert set.union(*found[7:]) == {("control.json", 0o600)}
    assert {mode for _, mode in modes} == {0o700}
    assert not list(private.iterdir())
    assert not (out / "control.json").is_symlink()


def test_who_looks_for_secrets_finds_them(tmp_path):
    told, inherited, kept = "7a5c0ffee", "8b5c0ffee", "9c5c0ffee"
    (tmp_path / "run.log").write_text(kept)
    (tmp_path / "run.log").chmod(0o644)
    waits = [sys.executable, "-c", "import sys; print(flush=True); sys.stdin.read()", told]
    with subprocess.Popen(
        waits, env=os.environ | {"WORD": inherited}, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        process.stdout.readline()
        for secret, place in ((told, "cmdline"), (inherited, "environ"), (kept, "run.log")):
            ((name, _),) = seen([secret], [process.pid], [tmp_path])
            assert name == place
        assert seen([kept], [], [tmp_path]) == {("run.log", 0o644)}
        process.stdin.close()


# ---- after it


class Flying:
    """`affinet run` in a process of its own, seen from outside."""

    def __init__(self, out):
        self.out = out
        command = [*RUN, "--duration", "600", "--out", str(out)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()

    def password(self):
        control = self.out / "control.json"
        await_true(lambda: control.exists() and control.read_text().endswith("}}"), "the run never got going")
        return json.loads(control.read_text())["login"]["password"]

    def nursery(self):
        (nursery,) = (one for one in psutil.Process(self.process.pid).children() if one.name() == "nursery")
        return nursery

    def crew(self):
        return psutil.Process(self.process.pid).children(recursive=True)


def nothing_is_left(flying, private, password):
    """Of sockets, checkpoints and passwords."""
    return not list(private.iterdir()) and not seen([password], [], [flying.out])


# After a normal end: above; after signals that ask for one: test_interruption.py.
@pytest.mark.parametrize(("killed", "status"), [("agent 3", 1), ("launcher", -signal.SIGKILL)])
def test_secrets_are_gone_when_a_run_breaks_off(killed, status, out, private):
    with Flying(out) as flying:
        password, crew = flying.password(), flying.crew()
        assert list(private.iterdir())
        victims = [flying.process] if killed == "launcher" else [one for one in crew if one.name() == killed]
        victims[0].kill()
        assert flying.process.wait(PATIENCE) == status
        assert not psutil.wait_procs(crew, timeout=PATIENCE)[1]
        assert nothing_is_left(flying, private, password)


def test_what_is_left_where_launcher_and_nursery_are_killed_the_next_run_removes(out, private):
    with Flying(out) as flying:
        password, crew, nursery = flying.password(), flying.crew(), flying.nursery()
        flying.process.send_signal(signal.SIGSTOP)
        nursery.kill()
        flying.process.kill()
        flying.process.wait(PATIENCE)
        assert not psutil.wait_procs(crew, timeout=PATIENCE)[1]
        assert not nothing_is_left(flying, private, password)
    others = [private / "affinet-theirs", private / "affinet-file.log"]
    others[0].mkdir()
    others[1].touch()
    with private_folder() as held, private_folder() as another:
        assert {*private.iterdir()} == {held, another, *others}
        assert stat.S_IMODE(held.stat().st_mode) == 0o700
    assert {*private.iterdir()} == {*others}
    assert not seen([password], [], [out])
