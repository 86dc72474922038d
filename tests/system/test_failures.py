"""No death of any process leaves an orphan, a hang or an unreadable recording."""

import json
import signal
import subprocess
import sys
import time
from importlib import resources

import numpy as np
import psutil
import pytest
from awaiting import PATIENCE, await_true
from flying import PROCESSES
from rerun.chunk import RrdReader

from netem.medium import journal
from netem.medium.medium import JOURNAL

pytestmark = PROCESSES

SOON = 30.0  # what takes half a second on a quiet machine; a hang would take all of the patience


class Running:
    """A long run in a process of its own, flying when the block begins; nothing of it is left when it ends."""

    def __init__(self, out, scenario="corridor"):
        self.out = out
        self.scenario = scenario

    def __enter__(self):
        self.launcher = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "affinet",
                "run",
                str(self.scenario),
                "--duration",
                "60",
                "--json",
                "--out",
                str(self.out),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.children = []
        try:
            # Room for the recording is tried at the start, so its size alone says nothing.
            await_true(lambda: min(self.written("run.rrd"), 10 * self.written(JOURNAL)) > 100_000, "it never flew")
        except BaseException:  # a test that ran out of time too
            self.__exit__()
            raise
        self.children = psutil.Process(self.launcher.pid).children(recursive=True)
        return self

    def __exit__(self, *_):
        for process in [self.launcher, *self.children]:
            if process.is_running() if isinstance(process, psutil.Process) else process.poll() is None:
                process.kill()
        self.launcher.communicate()

    def written(self, name):
        path = self.out / name
        return path.stat().st_size if path.exists() else 0

    def child(self, name):
        return next(child for child in self.children if child.name() == name)

    def stopped(self):
        return [child for child in self.children if child.status() == psutil.STATUS_STOPPED]

    def ends(self):
        began = time.monotonic()
        said, complained = self.launcher.communicate(timeout=PATIENCE)
        _, alive = psutil.wait_procs(self.children, timeout=PATIENCE)
        assert not alive
        return time.monotonic() - began, said, complained


def moments(recording):
    chunks = RrdReader(str(recording)).stream().to_chunks()
    return sum(chunk.num_rows for chunk in chunks if str(chunk.entity_path) == "/metrics/tracking_error")


@pytest.mark.parametrize("name", ["agent 1", "netem", "world", "nursery"])
def test_a_death_ends_the_run_with_its_reason(name, out):
    with Running(out) as run:
        victim = run.child(name)
        victim.kill()
        took, said, _ = run.ends()
    summary = json.loads(said.splitlines()[-1])
    assert took < SOON
    assert run.launcher.returncode == 1
    assert summary["verdict"] == "fail"
    assert summary["reasons"] == [f"{name} (pid {victim.pid}) was killed by SIGKILL. It had said nothing."]
    assert moments(out / "run.rrd") > 10
    # Whoever died, the accounts say what became of everything up to the last tick that was written down.
    table = journal.read(out / JOURNAL)
    counts = dict(zip(*np.unique(table["verdict"].to_numpy(), return_counts=True), strict=True))
    messages = summary["messages"]
    assert messages["ticks"] == table["tick"].to_numpy().max() + 1 >= 50
    assert messages["offered"] == messages["ticks"] * 24 * 4
    assert messages["delivered"] == counts["delivered"]
    assert messages["dropped"] == {"lost": counts["dropped"]}
    assert messages["in_flight"] == 0


@pytest.mark.parametrize(
    "name",
    ["agent 1", pytest.param("netem", marks=pytest.mark.slow), pytest.param("world", marks=pytest.mark.slow)],
)
def test_who_is_frozen_ends_the_run_and_is_named_with_its_state(name, out):
    with Running(out) as run:
        frozen = run.child(name)
        frozen.suspend()
        took, said, _ = run.ends()
    reason = json.loads(said.splitlines()[-1])["reasons"][0]
    assert took < SOON  # 3 s of patience, a beat, 1.2 s of grace for a process that cannot even be asked to leave
    assert reason.startswith(f"{name} (pid ")
    assert f"(pid {frozen.pid}) is stopped (state T): nothing moved for " in reason


@pytest.mark.slow
def test_time_in_which_everybody_was_stopped_is_nobodys_silence(out):
    with Running(out) as run:
        everybody = [psutil.Process(run.launcher.pid), *run.children]
        for process in everybody:
            process.suspend()
        time.sleep(6)  # twice the patience
        for process in everybody:
            process.resume()
        recorded = run.written("run.rrd")
        await_true(lambda: run.written("run.rrd") > recorded + 50_000, "it did not fly on")
        run.launcher.send_signal(signal.SIGSTOP)  # and the launcher alone
        time.sleep(6)
        run.launcher.send_signal(signal.SIGCONT)
        recorded = run.written("run.rrd")
        await_true(lambda: run.written("run.rrd") > recorded + 50_000, "it did not fly on")
        run.launcher.send_signal(signal.SIGINT)
        run.ends()
    assert json.loads((out / "summary.json").read_text())["reasons"] == ["interrupted by SIGINT"]


def test_a_killed_launcher_leaves_no_orphan_and_a_readable_recording(out):
    with Running(out) as run:
        run.launcher.kill()
        took, _, _ = run.ends()
    assert took < SOON
    assert moments(out / "run.rrd") > 10


@pytest.fixture
def pausing(tmp_path):
    path = tmp_path / "pausing.toml"
    pause = '[[timeline]]\nverb = "pause"\nat = 0.1\nuntil = 59.0\nagents = [3, 4, 5]\n'
    path.write_text((resources.files("affinet.shipped") / "scenarios" / "corridor.toml").read_text() + pause)
    return path


def test_who_is_paused_leaves_with_a_killed_launcher(out, pausing):
    with Running(out, pausing) as run:
        await_true(lambda: len(run.stopped()) == 3, "nobody was paused")
        run.launcher.kill()
        took, _, _ = run.ends()
    assert took < SOON
    assert moments(out / "run.rrd") > 10


def test_the_death_of_a_paused_agent_ends_the_run_with_its_reason(out, pausing):
    with Running(out, pausing) as run:
        await_true(lambda: len(run.stopped()) == 3, "nobody was paused")
        victim = run.stopped()[0]
        victim.kill()
        took, said, _ = run.ends()
    assert took < SOON
    assert f"(pid {victim.pid}) was killed by SIGKILL" in json.loads(said.splitlines()[-1])["reasons"][0]


def test_ctrl_c_leaves_in_order(out):
    with Running(out) as run:
        run.launcher.send_signal(signal.SIGINT)
        took, _, complained = run.ends()
    assert run.launcher.returncode == 130
    assert took < SOON
    assert "interrupted" in complained
    assert moments(out / "run.rrd") > 10
