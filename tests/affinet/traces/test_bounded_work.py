"""Whatever a file says, it is read in bounded work: what would take more is refused in a line with the way out."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from affinet.cli import commands
from affinet.planning import csv_logs, traces
from affinet.scenario import bounds
from affinet.scenario.sections import TimeSection
from affinet.scenario.trace_files import Traced, TraceFile
from affinet.traces import fields, formats, summary
from affinet.traces.link_data import Quantity
from netem.core.links import Links
from netem.impairments import measured

WALL = "1700000000 1 2 up\n1700000010 1 2 down\n1700000020 1 2 up\n1700000030 1 2 down\n"
MOVES = "1700000000 0 0 1700000100 100 0\n1700000000 0 0\n"
WALL_TABLE = "time,src,dst,availability\n1700000000,1,2,1\n1700000010,1,2,0\n1700000020,1,2,1\n1700000030,1,2,0\n"
PAIR = Links.both_ways(2, [(1, 2)])
EVERY = np.ones(2, dtype=bool)
WAY_OUT = "give a larger --dt, or --begins where"


@pytest.fixture
def refused(tmp_path, capsys):
    def of(text, *given):
        file = tmp_path / "field.txt"
        file.write_text(text)
        assert commands.main(["trace", str(file), *given]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    return of


@pytest.mark.parametrize(
    ("text", "given", "says"),
    [
        (WALL, ["--fit", "gilbert", "--dt", "1"], f"3.4e+09 steps of 1 s on 2 links up to 1700000030 s, .*{WAY_OUT}"),
        (WALL, ["--fit", "gilbert", "--dt", "1e-9", "--begins", "1.7e9"], f"6e+10 steps of 1e-09 s .*{WAY_OUT}"),
        (WALL_TABLE, ["--fit", "best", "--dt", "0.1"], f"1.7e+10 steps .*{WAY_OUT}"),
        (MOVES, [], f"2 nodes up to 1700000100 s are 3.4e+09 looks, one each 1 s: .*{WAY_OUT}"),
        (MOVES, ["--dt", "1e-9", "--begins", "1.7e9"], f"2e+11 looks, one each 1e-09 s: .*{WAY_OUT}"),
        ("0 0 0\n1e9 1 1\n", ["--format", "bonnmotion"], f"2e+09 looks, .*{WAY_OUT}"),
        (WALL, ["--begins", "1.8e9"], "begins = 1800000000, and it ends at 1700000030 s: give a time of the file"),
    ],
)
def test_what_would_take_too_much_is_refused_with_the_way_out(text, given, says, refused):
    """Before: terabytes were asked for, or it went on for hours; and begins took no stamp of a clock on the wall."""
    parts = says.replace("+", r"\+")
    assert re.search(parts, refused(text, *given))


@pytest.mark.parametrize("text", [WALL, WALL_TABLE])
def test_stamps_of_a_clock_are_fitted_from_where_they_begin(text, tmp_path):
    (tmp_path / "field.txt").write_text(text)
    file = TraceFile(file=str(tmp_path / "field.txt"), begins=1.7e9)
    _, data, notes = traces.told(file, 1.0)
    assert data.ends == 30.0
    assert summary.sequences(data, 1.0)[0].sum() == 10
    assert not [note for note in notes if "begins" in note]
    _, _, notes = traces.told(file.model_copy(update={"begins": 0.0}), 1.0)
    assert any(
        "nothing before 1700000000 s, longer than all it tells of: begins = 1700000000" in note for note in notes
    )


def test_nodes_that_move_begin_there_too(tmp_path):
    (tmp_path / "field.txt").write_text(MOVES)
    _, data, _ = traces.told(TraceFile(file=str(tmp_path / "field.txt"), begins=1.7e9 + 50), 1.0)
    far = data.steps[Quantity.DISTANCE]
    assert far.value[(far.src == 0) & (far.time == 10.0)].tolist() == [60.0]


def rates(tmp_path, text, begins=0.0, duration=4.0, dt=0.001):
    (tmp_path / "lte.txt").write_text(text)
    said = Traced.model_validate({"model": "trace", "file": str(tmp_path / "lte.txt"), "begins": begins})
    return traces.measured(said, Quantity.RATE, PAIR, EVERY, TimeSection(dt=dt, duration=duration))[0]


def test_what_begins_anew_is_bounded_and_turns_around_where_a_run_begins(tmp_path):
    assert len(rates(tmp_path, "1\n", duration=1e6).time) == 2  # one value on each link, for as long as it takes
    with pytest.raises(measured.MeasuredError, match=r"0\.002 s again and again in 1e\+06 s are .* give a shorter run"):
        rates(tmp_path, "1\n1\n2\n", duration=1e6, dt=0.1)
    turned = rates(tmp_path, "2\n2\n10\n", begins=0.005, duration=0.01)
    own = turned.link == 0
    held = [turned.value[own & (turned.time <= at + 1e-9)][-1] for at in (0.0, 0.0045, 0.006, 0.007)]
    assert held == [0.0, 12e6, 24e6, 0.0]


READS = {
    "trace": lambda file: formats.read(file, None),
    "delays": measured.delays,
    "log": lambda file: csv_logs.read(file, None),
}


@pytest.mark.parametrize("kind", ["device", "pipe"])
@pytest.mark.parametrize("read", READS.values(), ids=READS)
def test_files_without_end_are_not_read(kind, read, tmp_path):
    file = Path("/dev/zero")
    if kind == "pipe":
        file = tmp_path / "pipe"
        os.mkfifo(file)
    with pytest.raises(ValueError, match="no regular file but a device or a pipe, which may have no end: write it to"):
        read(file)


def test_files_that_are_large_are_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(measured, "LARGEST", 20)
    (tmp_path / "large.txt").write_text("0.1\n" * 5)
    assert len(measured.delays(tmp_path / "large.txt")) == 5
    (tmp_path / "large.txt").write_text("0.1\n" * 6)
    with pytest.raises(
        measured.MeasuredError, match="it is larger than 2e-05 MB, and no more is read: cut it into parts"
    ):
        measured.delays(tmp_path / "large.txt")


def test_delays_of_a_table_have_a_bound(tmp_path):
    (tmp_path / "delays.txt").write_text("0.1\n1e300\n")
    with pytest.raises(measured.MeasuredError, match=r"line 2: 1e\+300 s are more than a day"):
        measured.delays(tmp_path / "delays.txt")


def test_both_rooms_have_the_same_latest_time():
    assert bounds.LATEST == fields.LATEST


def test_many_links_are_summed_up_in_one_go(tmp_path):
    """Before: every link looked through the rows of all."""
    nodes = range(1, 61)
    rows = [f"{t},{a},{b},{t % 2}" for t in range(3) for a in nodes for b in nodes if a != b]
    (tmp_path / "many.csv").write_text("time,src,dst,availability\n" + "\n".join(rows))
    found = summary.summaries(formats.read(tmp_path / "many.csv", None)[1])
    assert len(found) == 60 * 59
    assert {one.loss for one in found} == {0.5}
