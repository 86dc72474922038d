"""A long recording is in parts: each opens by itself, and all together are the recording."""

import socket
from collections import Counter

import pytest
from flying import plan_of
from recorded import rows

from affinet.runtimes.run import fly
from netem.core.parts import parts
from world.recording import recorder
from world.recording.file import listens, wrong_with

FAULT = 'timeline=[{verb="cut",at=0.5,until=1.0,links=["all"]}]'
SMALL = 400_000  # bytes; the layout alone takes half of it


def flown(out, name):
    plan = plan_of(name, "time.dt=0.02", "time.duration=8", "record.every=1", FAULT)
    assert fly(plan, "inprocess", out, lambda *_: None).verdict != "fail"
    return parts(out / "run.rrd")


@pytest.mark.parametrize("name", ["corridor", "localization", "target"])
def test_the_parts_are_the_recording_and_each_says_all_that_does_not_change(name, tmp_path, monkeypatch):
    (whole,) = flown(tmp_path / "whole", name)
    monkeypatch.setattr(recorder, "LARGEST", SMALL)
    files = flown(tmp_path / "parted", name)
    assert len(files) > 1
    assert max(file.stat().st_size for file in files) < whole.stat().st_size
    assert [wrong_with(file) for file in files] == [None] * len(files)
    changing, static = rows(whole)
    found = [rows(file) for file in files]
    # Where agents put their neighbours at first, and what their processes do, is said in each part again.
    repeated = {"/swarm/measured", *(f"/processes/{agent}" for agent in range(1, 11))}
    together = sum((each for each, _ in found), Counter())
    assert {path: n for path, n in together.items() if path not in repeated} == {
        path: n for path, n in changing.items() if path not in repeated
    }
    assert all(each.keys() >= changing.keys() & repeated for each, _ in found)
    # A reason for which messages are dropped has a name from its first message on.
    named = {path for path in static if path.startswith("/messages/")}
    assert len(named) == {"corridor": 3, "localization": 2, "target": 2}[name]
    for each, said in found:
        assert static.keys() - named <= said.keys() <= static.keys()
        assert named & each.keys() <= said.keys()


def test_a_part_that_breaks_off_fails_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "LARGEST", SMALL)
    torn = []

    def tear(*_):
        files = parts(tmp_path / "run" / "run.rrd")
        if len(files) == 2 and not torn:
            torn.append(files[1])
            files[1].unlink()
            files[1].touch()

    done = fly(
        plan_of("corridor", "time.dt=0.02", "time.duration=4", "record.every=1"), "inprocess", tmp_path / "run", tear
    )
    assert done.verdict == "fail"
    assert torn
    assert "run-2.rrd" in done.reasons[0]


def test_a_viewer_that_is_gone_is_not_waited_for():
    with socket.socket() as viewer:
        viewer.bind(("127.0.0.1", 0))
        viewer.listen()
        url = f"rerun+http://127.0.0.1:{viewer.getsockname()[1]}/proxy"
        assert listens(url)
    assert not listens(url)
    assert not listens("rerun+http://nowhere.invalid:1/proxy")
