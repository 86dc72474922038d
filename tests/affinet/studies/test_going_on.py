"""A study that was killed goes on from the cells that it has kept, and ends with the bits of one that was not."""

import errno
import os
import shutil
import subprocess
import sys
from dataclasses import fields, replace
from importlib import resources
from pathlib import Path

import grimp
import numpy as np
import psutil
import pytest
from awaiting import await_true
from flying import PROCESSES, plan_of

from affinet import rooms
from affinet.cli import commands
from affinet.studies import cells, identity, pool, record, study
from affinet.studies.batch import Runs
from affinet.studies.executor import Here, Lost
from affinet.studies.sealed import opened
from affinet.studies.sharing import Piece
from analysis.figures import curves
from analysis.metrics.indicator import Bounds

pytestmark = PROCESSES

STUDY = """\
title = "Small"
source = "nobody"
figure = "curves"
scenario = "corridor"
set = ["time.dt=0.05", "time.duration=0.5"]
full = { runs = 6 }
quick = { runs = 2 }
axes = [
  { name = "graph", values = { zhao7 = [] } },
  { name = "loss", values = { "0" = ["network.availability=1.0"], "0.5" = ["network.availability=0.5"] } },
  { name = "estimator", values = { held = ['agents.estimator="waits:Held"'], conral = ["agents.estimator=conral"] } },
]
claims = [{ says = "losses cost", check = "lower", of = { loss = "0" }, to = { loss = "0.5" } }]
"""

# Waits in flight as long as there is a fifo beside it, for somebody who never writes to it.
HELD = """\
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from agents.estimators.none import NoEstimator

@dataclass(frozen=True)
class Held(NoEstimator):
    def fuse(self, brief, state, heard, own):
        fifo = Path(__file__).with_name("fifo")
        if np.max(own.tick) == 3 and fifo.exists():
            fifo.read_bytes()
        return NoEstimator.fuse(self, brief, state, heard, own)
"""


@pytest.fixture
def small(tmp_path):
    """The file of a study, beside its module."""
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "waits.py").write_text(HELD)
    (folder / "small.toml").write_text(STUDY)
    return folder / "small.toml"


@pytest.fixture
def uninterrupted(small, tmp_path):
    """What it leaves when nobody ends it."""
    assert fly(small, tmp_path / "whole") == 0
    return left(tmp_path / "whole")


def fly(small, out, *options):
    return commands.main(["study", str(small), "--out", str(out), "--jobs", "1", *options])


def left(out):
    """The bytes of every file, by name."""
    return {path.name: path.read_bytes() if path.is_file() else b"" for path in out.iterdir()}


class Ending:
    """Batches of each case alone, in this process, until so many are done."""

    at_once = 4

    def __init__(self, after):
        self.after = after

    def each(self, work, given, watch):
        for number, made in Here().each(work, given, watch):
            if number == self.after:
                raise Lost("nobody is there any more")
            yield number, made


@pytest.fixture
def interrupted(small, tmp_path, monkeypatch):
    """The directory of a study that lost who flew it after two of its four cases."""
    return interrupt(small, tmp_path / "out", monkeypatch)


def interrupt(small, out, monkeypatch):
    with monkeypatch.context() as here:
        here.setattr(pool, "on_this_machine", lambda _: Ending(2))
        assert fly(small, out) == 1
    assert len([*(out / cells.FOLDER).iterdir()]) == 2
    return out


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_study_that_is_killed_ends_with_the_same_bytes(jobs, small, uninterrupted, tmp_path, capsys):
    out = tmp_path / "out"
    os.mkfifo(small.with_name("fifo"))
    command = [sys.executable, "-m", "affinet", "study", str(small), "--out", str(out), "--jobs", "3"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as flies:
        kept = out / cells.FOLDER
        await_true(lambda: len([*kept.glob("*.cell")]) == 2 or flies.poll() is not None, "no cells")
        assert flies.poll() is None, flies.communicate()  # those of conral are there, and the others wait
        workers = psutil.Process(flies.pid).children(recursive=True)
        flies.kill()
        flies.communicate()
    psutil.wait_procs(workers, timeout=60)
    assert {path.suffix for path in kept.iterdir()} == {".cell"}
    small.with_name("fifo").unlink()
    assert fly(small, out, "--jobs", jobs) == 0
    assert "Small: goes on from 12 of 24 runs" in capsys.readouterr().err
    assert left(out) == uninterrupted


KILLED = """
import os, signal, sys
from affinet.studies.executor import Lost
from affinet.studies.pool import Processes

def work(given):
    if given:
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    try:
        list(Processes(2).each(work, [0, 1, 0], id))
    except Lost as error:
        print(error)
"""


def test_a_worker_that_is_killed_is_told(tmp_path):
    (tmp_path / "killed.py").write_text(KILLED)
    command = [sys.executable, str(tmp_path / "killed.py")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.stdout == "a process that flew cases is gone, for want of memory perhaps\n", done.stderr


def test_a_study_whose_workers_are_gone_says_how_it_goes_on(small, uninterrupted, tmp_path, monkeypatch, capsys):
    out = interrupt(small, tmp_path / "out", monkeypatch)
    kept = f"12 runs are kept: the same command goes on from them with --out {out}"
    assert capsys.readouterr().err.splitlines()[-2:] == ["nobody is there any more", kept]
    assert fly(small, out) == 0
    assert left(out) == uninterrupted


@pytest.mark.parametrize(
    "damage", [lambda whole: whole[:-7], lambda whole: whole[:50] + b"?" + whole[51:], lambda _: b""]
)
def test_a_cell_that_is_not_whole_flies_anew(damage, small, interrupted, uninterrupted, capsys):
    cell = sorted((interrupted / cells.FOLDER).iterdir())[1]
    cell.write_bytes(damage(cell.read_bytes()))
    capsys.readouterr()
    assert fly(small, interrupted) == 0
    said = capsys.readouterr().err.splitlines()
    assert said[:2] == [f"{cell} is not whole: its runs fly anew", "Small: goes on from 6 of 24 runs"]
    assert left(interrupted) == uninterrupted


def test_a_cell_that_was_being_written_is_none(small, interrupted, uninterrupted):
    cell, _ = sorted((interrupted / cells.FOLDER).iterdir())
    cell.rename(cell.with_suffix(".part"))
    assert fly(small, interrupted) == 0
    assert left(interrupted) == uninterrupted


def other_grid(small):
    small.write_text(STUDY.replace("time.duration=0.5", "time.duration=0.6"))


def other_module(small):
    small.with_name("waits.py").write_text(f"{HELD}\nCHANGED = True\n")


def other_numpy(_):
    identity.version = lambda name: "1.0" if name == "numpy" else "2.0"


@pytest.mark.parametrize(
    ("change", "options", "says"),
    [
        (lambda _: None, ["--quick"], "different in the grid; name another"),
        (other_grid, [], "different in the grid, what flies; name another"),
        (other_module, [], "different in waits:Held in {folder}; name another"),
        (other_numpy, [], "numpy ({numpy}, here 1.0)"),
    ],
    ids=["quick", "another grid", "another module", "another NumPy"],
)  # fmt: skip
def test_cells_of_another_grid_are_refused_and_kept(change, options, says, small, interrupted, monkeypatch, capsys):
    monkeypatch.setattr(identity, "version", identity.version)
    change(small)
    before = left(interrupted / cells.FOLDER)
    capsys.readouterr()
    assert fly(small, interrupted, *options) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"'{interrupted}/cells' has cells of another grid, different in ")
    assert says.format(folder=small.parent, numpy=np.__version__) in line
    assert left(interrupted / cells.FOLDER) == before


def test_nobody_else_flies_into_the_directory_meanwhile(small, interrupted, capsys):
    with cells.held(interrupted, next(one for one, _, _ in read(interrupted)), print):
        assert fly(small, interrupted) == 2
    assert f"another process flies a study into '{interrupted}'" in capsys.readouterr().err
    assert fly(small, interrupted) == 0


def read(out):
    return [cells._unpacked(opened(path.read_bytes())) for path in (out / cells.FOLDER).iterdir()]


def test_a_report_that_failed_is_made_again_without_flying(small, uninterrupted, tmp_path, monkeypatch):
    out = tmp_path / "out"
    with monkeypatch.context() as here:
        here.setattr(curves, "curves", lambda *_: [][0])
        assert fly(small, out) == 1
    monkeypatch.setattr(study, "fly_together", lambda *_: pytest.fail("it flew"))
    assert fly(small, out) == 0
    (out / "report.log").unlink()
    assert left(out) == uninterrupted


def test_a_study_that_is_done_is_not_flown_again(small, uninterrupted, tmp_path, capsys):
    assert cells.FOLDER not in uninterrupted
    assert fly(small, tmp_path / "whole") == 2
    assert "holds a study already" in capsys.readouterr().err


def test_a_study_that_kept_nothing_leaves_no_directory(small, tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "on_this_machine", lambda _: Ending(0))
    assert fly(small, tmp_path / "out") == 1
    assert not (tmp_path / "out").exists()


# ---- a cell


@pytest.fixture
def runs():
    """Of two runs, three moments, four agents; with what is no number."""
    draws = np.random.default_rng(1)
    values = draws.normal(size=(2, 3, 4))
    values[0, 0, 0], values[1, 1, 1] = np.nan, np.inf
    return Runs(
        np.arange(3.0), values[:, 0, 0], values, Bounds(values + 1.0, values - 1.0),
        {"error": values[..., 0], "report:age": -values[..., 1]}, {"position": values[0], "known": values[0] > 0.0},
    )  # fmt: skip


def test_a_cell_is_read_as_it_was_kept_bit_for_bit(runs, tmp_path):
    piece = Piece(3, range(4, 6))
    with cells.held(tmp_path, {"a": "b"}, print) as kept:
        kept.keep(piece, runs)
        assert kept.runs == 2
    with cells.held(tmp_path, {"a": "b"}, print) as kept:
        assert [*kept.there] == [piece]
        again = kept.there[piece]
    assert identity.digest([getattr(again, field.name) for field in fields(Runs)]) == identity.digest(
        [getattr(runs, field.name) for field in fields(Runs)]
    )


def test_a_cell_has_its_name_once_it_is_on_the_disk(runs, tmp_path, monkeypatch):
    def refuse(_):
        raise OSError(28, "No space left on device")

    with cells.held(tmp_path, {"a": "b"}, print) as kept:
        with monkeypatch.context() as here:
            here.setattr(os, "fsync", refuse)
            with pytest.raises(OSError, match="No space"):
                kept.keep(Piece(0, range(2)), runs)
        assert kept.runs == 0
        assert not [*kept.folder.glob("*.cell")]
    with cells.held(tmp_path, {"a": "b"}, print) as kept:
        assert not kept.there
    assert not kept.folder.exists()


# ---- what its bits come of


def test_the_code_that_counts_is_all_that_a_cell_goes_through():
    graph = grimp.build_graph("affinet", "agents", "world", "netem", "analysis", cache_dir=None)
    counted = [rooms.folder(room) / part for room, parts in identity._FLIES.items() for part in parts]
    for module in graph.find_upstream_modules("affinet.studies.batch"):
        room, *steps = module.split(".")
        file = rooms.folder(room).joinpath(*steps)
        file = file / "__init__.py" if file.is_dir() else file.with_suffix(".py")
        assert any(file.is_relative_to(part) for part in counted) or file.name == "__init__.py", module


def test_a_line_of_code_more_is_another_code(tmp_path, monkeypatch):
    here, copies = identity.here([])["affinet"], {}
    for room in identity._FLIES:
        copies[room] = tmp_path / room
        shutil.copytree(rooms.folder(room), copies[room], ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(rooms, "folder", copies.__getitem__)
    assert identity.here([])["affinet"] == here
    figures, law = copies["analysis"] / "figures" / "curves.py", copies["agents"] / "laws" / "single.py"
    figures.write_text(f"{figures.read_text()}\n# a figure is not flown")
    assert identity.here([])["affinet"] == here
    law.write_text(f"{law.read_text()}\n# a law is")
    assert identity.here([])["affinet"] != here


def test_a_digest_is_of_every_bit():
    values = [1, 1.0, True, "1", b"1", None, -0.0, 0.0, np.zeros(2), np.zeros(2, dtype=np.int64), np.zeros((1, 2))]
    values += [np.array([0.0, -0.0]), [1], (1,), [[1], 2], [1, [2]], [1, 2], {"a": 1}, {"a": 2}, {"b": 1}, Path("1")]
    assert len({identity.digest(value) for value in values}) == len(values)
    plan = plan_of("corridor", "time.dt=0.05", "time.duration=0.5")
    nudged = replace(plan, world=replace(plan.world, ticks=plan.world.ticks + 1))
    assert identity.digest(plan) == identity.digest(replace(plan))
    assert identity.digest(plan) != identity.digest(nudged)


@pytest.mark.parametrize(("threads", "alike"), [("1", True), ("2", False)])
def test_the_rounding_of_this_machine_is_told(threads, alike):
    code = "import numpy; from affinet.studies import identity; print(identity._rounding())"
    environment = os.environ | {"OPENBLAS_NUM_THREADS": threads, "PYTHONHASHSEED": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert (done.stdout.strip() == identity._rounding()) == alike


def test_what_is_edited_while_a_study_flies_is_not_what_is_recorded(small, tmp_path, monkeypatch):
    scenario = small.with_name("own.toml")
    scenario.write_text((resources.files("affinet.shipped") / "scenarios" / "corridor.toml").read_text())
    small.write_text(STUDY.replace('scenario = "corridor"', 'scenario = "own.toml"'))
    flown, fly_all = record.grid(study.load(str(small)), quick=True), study.fly

    def edited(*given):
        results = [*fly_all(*given)]
        scenario.write_text(scenario.read_text().replace("spread = 1.0", "spread = 5.0"))
        return iter(results)

    monkeypatch.setattr(study, "fly", edited)
    assert fly(small, tmp_path / "out", "--quick") == 0
    assert record.read(tmp_path / "out" / record.FILE).flown == flown != record.grid(study.load(str(small)), quick=True)


def test_a_disk_that_is_full_leaves_no_verdicts_that_are_not_whole(small, tmp_path, monkeypatch, capsys):
    def no_room(path, *_, **__):
        path.touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as full:
        full.setattr(Path, "write_text", no_room)
        assert fly(small, tmp_path / "out", "--quick") == 1
    left_over = {file.name for file in (tmp_path / "out").iterdir()}
    assert left_over == {"cells", "results.nc"}
    assert capsys.readouterr().err.splitlines()[-1].endswith("OSError(28, 'No space left on device')")
    assert fly(small, tmp_path / "out", "--quick") == 0
    assert record.read(tmp_path / "out" / record.FILE).quick


def test_a_disk_that_is_full_under_a_cell_is_said_with_the_cell(small, tmp_path, monkeypatch, capsys):
    def no_room(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_room)
    assert fly(small, tmp_path / "out", "--quick") == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert ".part': No space left on device; free some room" in said
