"""What a study cannot draw or judge is said before anything flies; what has flown is kept, and nobody flies on alone."""

import os
import signal
import subprocess
import sys

import netcdf
import psutil
import pytest
from flying import PROCESSES, plan_of

from affinet.cli import commands
from affinet.scenario.wrong import ScenarioError
from affinet.studies import pool, study
from affinet.studies.batch import fly_all
from analysis.figures import curves

pytestmark = PROCESSES

SMALL = """\
title = "Small"
source = "nobody"
figure = "curves"
scenario = "corridor"
set = ["time.dt=0.05", "time.duration=0.5"]
full = { runs = 2 }
quick = { runs = 2 }

[[axes]]
name = "graph"
values = { zhao7 = [] }

[[axes]]
name = "law"
values = { static = ['agents.law="static"'], varying = [] }

[[axes]]
name = "loss"
values = { "0" = ["network.availability=1.0"], "0.5" = ["network.availability=0.5"] }

[[claims]]
says = "losses cost something"
check = "lower"
of = { law = "static", loss = "0" }
to = { law = "static", loss = "0.5" }
"""
RATIO = 'check = "ratio"\nbetween = [0.5, 1.5]'
THIRD_AXIS = SMALL[SMALL.index('[[axes]]\nname = "loss"') : SMALL.index("[[claims]]")]


def small(tmp_path, *changes):
    """A study file, changed."""
    text = SMALL
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "small.toml"
    path.write_text(text)
    return path


# Each of these failed when all had flown: in the figure, in a verdict, or by a figure or a verdict of no number.
NOT_FLOWN = [
    pytest.param(
        [(THIRD_AXIS, ""), (', loss = "0"', ""), (', loss = "0.5"', "")],
        "axes: the figure 'curves' is drawn over three axes, one for columns, one for rows, one for the curves; there are 2; "
        "an axis of one label, like { all = [] }, fills a place",
        id="two axes",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "sweep"')],
        "along: is missing: name the axis that the sweep runs along, one of graph, law, loss",
        id="a sweep along nothing",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "sweep"\nalong = "los"')],
        "along: no axis is called 'los'; did you mean 'loss'? there are graph, law, loss",
        id="along no axis",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "sweep"\nalong = "law"')],
        "small.toml:16: axes.2.values: a sweep runs along numbers, and the label 'static' is none",
        id="along words",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "sweep"\nalong = "loss"'), ('"0" =', '"nan" ='), ('loss = "0" }', 'loss = "nan" }')],
        "a sweep runs along numbers, and the label 'nan' is none",
        id="along nan",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "curves"\nalong = "loss"')],
        "small.toml:4: along: is of a sweep, and the figure is 'curves': leave it out",
        id="curves along",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "indicator"')],
        "figure: 'indicator' is drawn of one case, and there are 4: give every axis one label",
        id="an indicator of four cases",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "paths"'), (", varying = []", ', varying = [], "3" = [], "4" = [], "5" = []')],
        "figure: 'paths' are drawn of at most 8 cases, and there are 10: give axes fewer labels",
        id="paths of ten cases",
    ),
    pytest.param(
        [('figure = "curves"', 'figure = "paths"\nalso = ["peak"]')],
        "also is of curves and sweeps, and the figure is 'paths': leave it out",
        id="paths of a quantity",
    ),
    pytest.param(
        [("set =", 'also = ["peak", "agreed"]\nset =')],
        "also.2: 'agreed' is of agents that pursue a target; nobody does in the case graph=zhao7",
        id="also of nobody",
    ),
    pytest.param([("set =", 'also = ["eror"]\nset =')], "got \"eror\"; did you mean 'error'?", id="also a quantity"),
    pytest.param([('name = "law"', 'name = "graph"')], "axes.2.name: two axes are called 'graph'", id="two of a name"),
    pytest.param([('name = "graph"', 'name = "run"')], "axes.1.name: 'run' is a name in the data already", id="a name"),
    pytest.param([("{ zhao7 = [] }", "{}")], "axes.1.values: has no label: give at least one", id="no label"),
    pytest.param(
        [("full = ", 'skip = [{ graph = "zhao7" }]\nfull = ')], "small.toml:6: skip: leaves no case to fly", id="no case"
    ),
    pytest.param(
        [("full = ", 'skip = [{ loss = "0" }]\nfull = ')],
        "claims.1.of: no case has the labels law=static, loss=0: all are left out by skip",
        id="a claim on what is left out",
    ),
    pytest.param(
        [('check = "lower"', RATIO), ('of = { law = "static", loss = "0" }', 'of = { loss = "0" }')],
        "claims.1.of: 'ratio' is judged of one case, and 2 have the labels loss=0: name a label of every axis",
        id="a ratio of two cases",
    ),
    pytest.param(
        [('of = { law = "static", loss = "0" }', "of = {}"), ('to = { law = "static", loss = "0.5" }', 'to = { loss = "0" }')],
        "claims.1.to: 4 cases are compared with 2: as many as them, or one, can be",
        id="four against two",
    ),
    pytest.param([("runs = 2", "runs = 1")], "claims.1.check: 'lower' needs more than one run of each case", id="one run"),
    pytest.param([("check =", "since = 3.0\ncheck =")], "claims.1.since: no moment lies in the span from 3 s on", id="since"),
    pytest.param(
        [("check =", "since = 0.3\nuntil = 0.2\ncheck =")],
        "claims.1.until: is 0.2 s, and since 0.3 s: until must be later",
        id="until before since",
    ),
    pytest.param(
        [("set =", "since = 2.0\nset =")],
        "since: no moment lies in the span from 2 s on: the last moment of the case graph=zhao7, law=static, loss=0 is 0.45 s",
        id="drawn since",
    ),
    pytest.param(
        [("check =", 'quantity = "localization"\ncheck =')],
        "claims.1.quantity: 'localization' is of agents that find out where they are; nobody does in the case graph=zhao7",
        id="nobody localizes",
    ),
    pytest.param(
        [("set =", 'quantity = "agreed"\nset =')],
        "quantity: 'agreed' is of agents that pursue a target; nobody does in the case graph=zhao7",
        id="nobody pursues",
    ),
    pytest.param(
        [("zhao7 = []", "zhao7 = ['agents.estimator=\"rkf\"']"), ('check = "lower"', 'check = "indicator_below_error"'),
         ('to = { law = "static", loss = "0.5" }', "")],
        "claims.1.check: the indicator is of estimators that tell a map, like conral; case graph=zhao7, law=static, loss=0 has "
        "another: 'rkf'",
        id="no map",
    ),
    pytest.param(
        [("zhao7 = []", "zhao7 = ['network.zones=[{ centre = [0.0, 0.0], radius = 1.0 }]']")],
        "scenario: case graph=zhao7, law=static, loss=0: an air with a jammed zone is not flown side by side",
        id="no batch",
    ),
    pytest.param(
        [("zhao7 = []", 'zhao7 = ["time.dt"]')],
        "small.toml: case graph=zhao7, law=static, loss=0: override time.dt: write it as key=value",
        id="no override",
    ),
    pytest.param(
        [("zhao7 = []", "zhao7 = 3")],
        'small.toml:11: axes.1.values.zhao7: should be a list, like ["agents.law=',
        id="no list of overrides",
    ),
    pytest.param(
        [("quick = { runs = 2 }", "")], "quick: is missing; it has no default: give a table, like { runs = 5 }", id="quick"
    ),
    pytest.param(
        [('scenario = "corridor"', 'scenario = "coridor"')], "no such scenario; did you mean 'corridor'?", id="scenario"
    ),
    pytest.param([('figure = "curves"', 'figure = "curve"')], "got \"curve\"; did you mean 'curves'?", id="figure"),
    pytest.param([("set =", 'quantity = "eror"\nset =')], "got \"eror\"; did you mean 'error'?", id="quantity"),
    pytest.param(
        [('law = "static", loss = "0.5"', 'lwa = "static"')],
        "small.toml:25: claims.1.to: no axis 'lwa' has the label 'static'; no axis is called so: did you mean 'law'?",
        id="axis",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "says"), NOT_FLOWN)
def test_what_cannot_be_drawn_or_judged_is_one_line_before_anything_flies(changes, says, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(study, "fly", lambda *_: pytest.fail("it flew"))
    out = tmp_path / "out"
    assert commands.main(["study", str(small(tmp_path, *changes)), "--quick", "--out", str(out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("small.toml") or "no such scenario" in line
    assert says in line
    assert not out.exists()


def test_the_study_that_these_are_mistakes_in_is_right(tmp_path):
    assert len(study.plans(study.load(str(small(tmp_path))), quick=True)) == 4


# ---- what was flown is kept


class Done:
    """Batches flown in this process, as many as the study has cases: no worker, no wait."""

    at_once = 4

    def __init__(self, fail_after=None):
        self.fail_after = fail_after

    def each(self, work, given, _watch):
        for number, one in enumerate(given):
            if number == self.fail_after:
                raise KeyboardInterrupt
            yield number, work(one)


def fly_in(executor, monkeypatch):
    monkeypatch.setattr(pool, "on_this_machine", lambda _: executor)


def test_a_study_whose_figure_fails_has_left_its_data_and_says_so(tmp_path, monkeypatch, capsys):
    fly_in(Done(), monkeypatch)
    monkeypatch.setattr(curves, "curves", lambda *_: [][0])
    out = tmp_path / "out"
    assert commands.main(["study", str(small(tmp_path)), "--quick", "--out", str(out)]) == 1
    assert netcdf.flown(out) == (4, 2)
    assert (out / "claims.json").exists()
    *cases, line = [line for line in capsys.readouterr().err.splitlines() if line]
    assert [case.partition(" cases")[0] for case in cases] == [
        f"{study.load(str(small(tmp_path))).title}: {n}/4" for n in (1, 2, 3, 4)
    ]
    assert (
        line
        == f"{out} has the data, but not all of the report: IndexError('list index out of range'); {out}/report.log says where"
    )
    assert "test_study_checks.py" in (out / "report.log").read_text()


def test_a_study_that_is_interrupted_leaves_the_cases_that_are_done(tmp_path, monkeypatch):
    fly_in(Done(fail_after=3), monkeypatch)
    out = tmp_path / "out"
    assert commands.main(["study", str(small(tmp_path)), "--quick", "--out", str(out)]) == 130
    assert netcdf.flown(out) == (3, 2)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT], ids=lambda one: one.name)
def test_a_study_that_is_told_to_end_leaves_the_cases_that_are_done(number, tmp_path, monkeypatch, capsys):
    class Ended(Done):
        def each(self, work, given, _watch):
            for place, one in enumerate(given):
                if place == 3:
                    signal.raise_signal(number)
                yield place, work(one)

    fly_in(Ended(), monkeypatch)
    before, out = signal.getsignal(number), tmp_path / "out"
    assert commands.main(["study", str(small(tmp_path)), "--quick", "--out", str(out)]) == 128 + number
    assert netcdf.flown(out) == (3, 2)
    assert f"interrupted by {number.name}" in capsys.readouterr().err
    assert signal.getsignal(number) == before


# ---- workers

WAITS = """
import os, sys, time
from affinet.studies.pool import Processes

def nothing(_):
    pass

def work(fifo):
    with open(fifo, "w") as tell:
        tell.write(str(os.getpid()))
    while True:
        time.sleep(60)

if __name__ == "__main__":
    list(Processes(2).each(work, [sys.argv[1]] * 4, nothing))
"""


@pytest.mark.parametrize(
    "number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL, signal.SIGHUP], ids=lambda one: one.name
)
def test_no_worker_outlives_the_process_that_waits_for_it(number, tmp_path):
    script, fifo = tmp_path / "waits.py", tmp_path / "fifo"
    script.write_text(WAITS)
    os.mkfifo(fifo)
    with subprocess.Popen([sys.executable, str(script), str(fifo)], stderr=subprocess.PIPE, text=True) as waits:
        with fifo.open() as told:
            assert told.read()  # a worker works
        left = psutil.Process(waits.pid).children(recursive=True)
        assert left
        waits.send_signal(number)
        _, said = waits.communicate(timeout=60)
        gone, alive = psutil.wait_procs(left, timeout=60)
        for one in alive:
            one.kill()
    assert not alive
    assert len(gone) == len(left)
    assert waits.returncode != 0
    assert said.count("Traceback") <= (number == signal.SIGINT)  # of the one that waited, never of a worker


def test_work_that_fails_ends_all_that_is_under_way(tmp_path):
    script = tmp_path / "fails.py"
    script.write_text(
        "from affinet.studies.pool import Processes\n"
        "def work(number):\n    return 1 // number\n"
        'if __name__ == "__main__":\n'
        "    print(sorted(Processes(2).each(work, [1, 1], print)))\n    list(Processes(2).each(work, [0, 1, 1], id))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=100, check=False)
    assert done.stdout.splitlines()[-1] == "[(0, 1), (1, 1)]"
    assert done.returncode == 1
    assert "ZeroDivisionError" in done.stderr.splitlines()[-1]


TELLS = """
import os, sys
from affinet.studies.executor import tell
from affinet.studies.pool import on_this_machine

def work(given):
    share, told, go_on = given
    tell(share)
    os.close(os.open(told, os.O_RDWR))
    os.close(os.open(go_on, os.O_RDONLY))
    return share

if __name__ == "__main__":
    seen = []
    def watch(shares):
        seen.append(shares[0])
        if shares[0] and len(seen) > 1:
            os.close(os.open(sys.argv[2], os.O_WRONLY))
    print(list(on_this_machine(int(sys.argv[3])).each(work, [(0.25, *sys.argv[1:3])], watch)), seen[-1])
"""


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_work_says_how_far_it_is_to_whom_waits_for_it(jobs, tmp_path):
    script, told, go_on = tmp_path / "tells.py", tmp_path / "told", tmp_path / "go_on"
    script.write_text(TELLS)
    for fifo in (told, go_on):
        os.mkfifo(fifo)
    command = [sys.executable, str(script), str(told), str(go_on), jobs]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.stdout == "[(0, 0.25)] 0.25\n", done.stderr


def test_a_flight_tells_which_share_of_it_is_done():
    plan, told = plan_of("corridor", "time.dt=0.05", "time.duration=0.2"), []
    fly_all(plan, range(1, 202), 1, told.append)  # in two parts
    assert told == [each / 8 for each in range(1, 9)]


def test_a_study_in_a_file_is_named_with_it(tmp_path):
    with pytest.raises(ScenarioError, match=r"^small\.toml:2: "):
        study.load(str(small(tmp_path, ('source = "nobody"', "source = 3"))))


@pytest.mark.parametrize(
    ("number", "key"),
    [
        ("since = nan", "since"), ("since = -1.0", "since"), ("until = inf", "until"), ("until = nan", "until"),
        ('check = "flat"\nlevel = inf', "level"), ('check = "flat"\nlevel = nan', "level"),
        ('check = "ratio"\nbetween = [nan, 1.0]', "between"), ('check = "ratio"\nbetween = [0.5, inf]', "between"),
        ('check = "flat"\neach = ["loss"]\nlevels = { "0" = nan }', "levels"),
    ],
)  # fmt: skip
def test_numbers_of_a_claim_that_say_nothing_are_refused(number, key, tmp_path, capsys):
    check = 'check = "lower"'
    path = small(tmp_path, (check, number if number.startswith("check") else f"{check}\n{number}"))
    assert commands.main(["study", str(path), "--quick", "--out", str(tmp_path / "report")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("small.toml:")
    assert f"claims.1.{key}" in line
    assert "should be a finite number" in line or "should be greater than or equal to 0" in line
