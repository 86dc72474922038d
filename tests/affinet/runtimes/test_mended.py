"""Recordings that break off, at any byte: mended, or removed where nothing is in them, and by one command as a rule."""

import pytest
from flying import plan_of
from rerun.chunk import RrdReader

from affinet.runtimes import rerun_command
from affinet.runtimes.run import fly
from world.recording.file import wrong_with


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("recording") / "run"
    fly(plan_of("corridor", "time.duration=1"), "inprocess", out, lambda *_: None)
    return out / "run.rrd"


@pytest.fixture
def asked(monkeypatch):
    """The commands that are run, each of which takes seconds on a busy machine."""
    commands, run = [], rerun_command._rrd
    monkeypatch.setattr(rerun_command, "_rrd", lambda *words: commands.append(words[0]) or run(*words))
    return commands


def broken_off(whole, path, size):
    path.write_bytes(whole.read_bytes()[:size])
    return path


@pytest.mark.parametrize("share", [0.3, 0.7, 0.999])
def test_it_is_mended_by_one_command(share, whole, asked, tmp_path):
    path = broken_off(whole, tmp_path / "run.rrd", round(share * whole.stat().st_size))
    assert wrong_with(path)
    rerun_command.mend(path)
    assert wrong_with(path) is None
    assert RrdReader(str(path)).stream().to_chunks()
    assert asked == ["merge"]


@pytest.mark.parametrize("size", [12, 28, 40])
def test_where_nothing_is_in_it_nothing_is_left(size, whole, asked, tmp_path):
    rerun_command.mend(broken_off(whole, tmp_path / "run.rrd", size))
    assert list(tmp_path.iterdir()) == []
    assert asked == ["merge", "compare"]
