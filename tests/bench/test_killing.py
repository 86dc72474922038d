"""What `bench/kills.py` finds wrong, planted."""

import sys

import numpy as np
import pytest
from awaiting import await_true
from killing import left
from killing.runs import Run

from world.books import timing
from world.books.kept import Kept

ALL = dict.fromkeys(("journal", "arrays", "graph", "recording", "timing", "deliveries"), 40)


def test_all_that_ends_within_a_second_of_the_kill_is_well():
    assert left.too_short(ALL, flown_s=2.9, late_s=0.0, dt_s=0.05) == []
    assert left.too_short(ALL, flown_s=3.1, late_s=0.2, dt_s=0.05) == []


@pytest.mark.parametrize("what", ALL)
def test_what_ends_earlier_is_named(what):
    (said,) = left.too_short(ALL | {what: 30}, flown_s=2.9, late_s=0.1, dt_s=0.05)
    assert said == f"it flew for 2.90 s, 0.10 s late at most, and the {what} ends 1.40 s before that"


@pytest.mark.parametrize("what", ALL)
def test_what_is_missing_is_named(what):
    rest = {name: ticks for name, ticks in ALL.items() if name != what}
    assert left.too_short(rest, flown_s=2.0, late_s=0.0, dt_s=0.05) == [f"it flew for 2.00 s, and left no {what}"]


def test_what_cannot_be_read_is_said(tmp_path):
    (tmp_path / "journal.arrows").write_bytes(b"no table")
    with pytest.raises(left.Unreadable, match=r"journal: .*no such table"):
        left.ticks(tmp_path, was_ended=True)


def test_how_late_a_run_was_is_how_late_its_world_was(tmp_path):
    writer = timing.TimingWriter(tmp_path)
    writer.write([Kept(0, "world", 0.25, 0), Kept(1, "world", 0.5, 1), Kept(1, "agent 1", 3.0, 1)])
    writer.close()
    assert left.late_s(tmp_path) == np.float64(0.5)


def test_a_process_that_is_left_behind_is_found(tmp_path):
    orphan = "[sys.executable, '-c', 'import signal; signal.pause()']"
    with Run(tmp_path, [sys.executable, "-c", f"import subprocess, sys; subprocess.Popen({orphan})"]) as run:
        run.launcher.wait()
        assert len(run.processes()) == 1
    await_true(lambda: not run.processes(), "it was not ended")
