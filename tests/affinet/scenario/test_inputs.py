"""Files that a scenario names: found beside what names them from any folder, and copied into the run directory."""

import json
import shutil

import pytest
from flying import PROCESSES

from affinet.cli import commands
from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.studies import study
from affinet.testing.swarm import SwarmRuns
from world.books.history import digest

pytestmark = PROCESSES

SCENARIO = """
[formation]
preset = "zhao7"
[manoeuvre]
preset = "hover"
[time]
dt = 0.05
duration = 0.5
[sensing]
sigma = 0.1
[agents]
estimator = "{estimator}"
law = "varying-velocity"
[record]
enabled = false
[network]
profile = "traced"
[network.profiles.traced]
loss = [{{ model = "trace", file = "field/trace.csv" }}]
delay = {{ model = "table", table = "field/pings.txt" }}
"""
OWN = """from dataclasses import dataclass
from agents.estimators.none import NoEstimator
from helper import FACTOR

@dataclass(frozen=True)
class Mine(NoEstimator):
    share: float = 1.0

    def fuse(self, *told):
        state, estimate = super().fuse(*told)
        return state, estimate._replace(relative=estimate.relative * self.share * FACTOR)
"""
STUDY = """
title = "Mine"
source = "me"
figure = "curves"
scenario = "../mine.toml"
full = { runs = 1 }
quick = { runs = 1 }
[[axes]]
name = "column"
values = { here = [] }
[[axes]]
name = "row"
values = { here = [] }
[[axes]]
name = "trace"
values = { half = ['network.profiles.traced.loss=[]', 'network.profiles.traced.delay.table="half.txt"'] }
"""


def trace_text(availability):
    links = planning.make(loading.load("corridor")).world.links
    rows = "".join(f"0,{src},{dst},{availability}\n" for src, dst in links.index)
    return f"time,src,dst,availability\n{rows}"


def field(folder, *, availability=0.5, factor=0.9, estimator="mine:Mine"):
    """A scenario with a trace, delays, and an estimator of its own, whose helper lies beside it."""
    (folder / "field").mkdir(parents=True, exist_ok=True)
    (folder / "field" / "trace.csv").write_text(trace_text(availability))
    (folder / "field" / "pings.txt").write_text("0.02\n0.0\n0.12\n")
    (folder / "mine.py").write_text(OWN)
    (folder / "helper.py").write_text(f"FACTOR = {factor}\n")
    (folder / "mine.toml").write_text(SCENARIO.format(estimator=estimator))
    return folder / "mine.toml"


def digest_of(given):
    return digest(rehearse(planning.make(given)).arrays)


def complaint(*arguments, **keys):
    with pytest.raises(ScenarioError) as caught:
        planning.make(loading.load(*arguments, **keys))
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A working directory in which files of the same names lie, of other contents."""
    field(tmp_path / "elsewhere", availability=1.0, factor=-1.0)
    monkeypatch.chdir(tmp_path / "elsewhere")
    return tmp_path / "elsewhere"


@pytest.mark.usefixtures("elsewhere")
def test_what_a_scenario_names_lies_beside_it_wherever_one_works(tmp_path, monkeypatch):
    """Before: trace and module were looked for in the working directory: other files, or none."""
    file = field(tmp_path / "home")
    there = digest_of(loading.load(str(file)))
    monkeypatch.chdir(tmp_path / "home")
    assert digest_of(loading.load("mine.toml")) == there
    assert digest_of(loading.load("../elsewhere/mine.toml")) != there


@pytest.mark.usefixtures("elsewhere")
def test_what_lies_only_in_the_working_directory_is_not_found(tmp_path):
    file = field(tmp_path / "home")
    (tmp_path / "home" / "mine.py").unlink()
    assert "agents.estimator: cannot load mine:Mine" in complaint(str(file))
    shutil.rmtree(tmp_path / "home" / "field")
    (tmp_path / "home" / "mine.py").write_text(OWN)
    (tmp_path / "home" / "field").mkdir()
    said = complaint(str(file))
    assert f"network.profiles.traced: delays {tmp_path}/home/field/pings.txt: no such file" in said
    (tmp_path / "home" / "field" / "pings.txt").write_text("0.01")
    assert f"trace {tmp_path}/home/field/trace.csv: no such file" in complaint(str(file))


def test_two_scenarios_have_modules_of_one_name(tmp_path):
    one, other = (loading.load(str(field(tmp_path / name, factor=f))) for name, f in (("a", 0.9), ("b", 0.5)))
    plans = [planning.make(given) for given in (one, other)]
    digests = [digest(rehearse(plan).arrays) for plan in (*plans, *plans)]
    assert digests[:2] == digests[2:]
    assert digests[0] != digests[1]


def test_on_the_command_line_paths_and_modules_are_those_of_the_working_directory(tmp_path, elsewhere):
    file = field(tmp_path / "home", estimator="none")
    shutil.rmtree(tmp_path / "home" / "field")
    sets = [
        "network.profiles.traced.delay.table=field/pings.txt",
        'network.profiles.traced.loss=[{model="trace",file="field/trace.csv"}]',
        "agents.estimator=mine:Mine",
    ]
    assert commands.main(["check", str(file), *(word for one in sets for word in ("--set", one))]) == 0
    given = loading.load(str(file), sets, elsewhere)
    assert given.own_modules == {"mine:Mine": elsewhere}
    (elsewhere / "mine.py").unlink()
    assert loading.load(str(file), sets, elsewhere).own_modules == {"mine:Mine": tmp_path / "home"}


@pytest.mark.usefixtures("elsewhere")
def test_a_study_names_what_lies_beside_it(tmp_path):
    field(tmp_path / "home")
    (tmp_path / "home" / "studies").mkdir()
    (tmp_path / "home" / "studies" / "mine.toml").write_text(STUDY)
    (tmp_path / "home" / "studies" / "half.txt").write_text("0.5\n")
    mine = study.load(str(tmp_path / "home" / "studies" / "mine.toml"))
    (case,) = study.cases(mine, quick=True)
    plan = study._planned(mine, case)
    assert plan.profiles[0].delays[0].table.tolist() == [0.5]
    assert plan.estimator.folder == str(tmp_path / "home")


@pytest.mark.usefixtures("elsewhere")
def test_a_test_names_what_lies_beside_it(tmp_path):
    field(tmp_path / "home")
    swarm = SwarmRuns("inprocess", None, lambda: tmp_path / "room", tmp_path / "home")
    shipped = swarm("corridor", "time.dt=0.05", 'agents.estimator="mine:Mine"', "time.duration=0.5")
    assert shipped.scenario.own_modules == {"mine:Mine": tmp_path / "home"}
    late = swarm("mine.toml").fault("cut", links=["1-2"], at=0.1, until=0.3)
    assert digest_of(late.scenario) == digest(late.fly().arrays)
    assert digest_of(late.scenario) != digest_of(loading.load(str(tmp_path / "home" / "mine.toml")))


@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_a_run_is_flown_again_from_any_folder_after_its_files_are_gone(runtime, tmp_path, capsys):
    """Before: a replay read the originals, relative to the working directory."""
    file = field(tmp_path / "home")
    first = fly(planning.make(loading.load(str(file))), runtime, tmp_path / "run", lambda *_: None)
    assert first.verdict == "pass", first.reasons
    shutil.rmtree(tmp_path / "home")
    shutil.move(tmp_path / "run", tmp_path / "moved")
    again = ["replay", str(tmp_path / "moved"), "--runtime", "inprocess", "--out", str(tmp_path / "again")]
    assert commands.main(again) == 0
    said = capsys.readouterr().err
    assert "the same bits as" in said
    assert "note: " not in said
    assert (
        commands.main(["replay", str(tmp_path / "again"), "--runtime", "inprocess", "--out", str(tmp_path / "third")])
        == 0
    )
    kept = json.loads((tmp_path / "third" / "inputs" / "inputs.json").read_text())
    assert sorted(kept["originals"]) == ["modules/helper.py", "modules/mine.py", "pings.txt", "trace.csv"]


@pytest.mark.parametrize(
    ("name", "text"),
    [("field/trace.csv", trace_text(1.0)), ("field/pings.txt", "9.0\n"), ("helper.py", "FACTOR = 0.1\n")],
)
def test_a_replay_says_which_original_is_not_what_it_was(name, text, tmp_path, capsys):
    file = field(tmp_path / "home")
    fly(planning.make(loading.load(str(file))), "inprocess", tmp_path / "run", lambda *_: None)
    (tmp_path / "home" / name).write_text(text)
    assert (
        commands.main(["replay", str(tmp_path / "run"), "--runtime", "inprocess", "--out", str(tmp_path / "again")])
        == 0
    )
    said = capsys.readouterr().err
    assert f"note: {tmp_path / 'home' / name} is not what it was: the copy inputs/" in said
    assert said.count("note: ") == 1
    assert "the same bits as" in said


def test_files_of_one_name_do_not_collide(tmp_path):
    file = field(tmp_path / "home", estimator="none")
    for name, availability in (("a", 0.25), ("b", 0.75)):
        (tmp_path / "home" / name).mkdir()
        (tmp_path / "home" / name / "trace.csv").write_text(trace_text(availability))
    (tmp_path / "home" / "inputs.json").write_text(trace_text(1.0))
    losses = [
        f'network.profiles.{name}.loss=[{{model="trace",file="{path}"}}]'
        for name, path in (("a", "a/trace.csv"), ("b", "b/trace.csv"), ("c", "inputs.json"))
    ]
    faults = (
        "timeline=[{verb='degrade',links=['1-2'],at=0.1,profile='a'},{verb='degrade',links=['1-3'],at=0.1,profile='b'}]"
    )
    plan = planning.make(loading.load(str(file), [*losses, faults]))
    fly(plan, "inprocess", tmp_path / "run", lambda *_: None)
    again = planning.again(tmp_path / "run", (), verdicts=False)
    worth = [float(profile.traces[0].availability.min()) for profile in again.profiles]
    assert worth == [0.5, 0.25, 0.75]
    told = json.loads((tmp_path / "run" / "scenario.json").read_text())["network"]["profiles"]
    files = [told[name]["loss"][0]["file"] for name in ("traced", "a", "b", "c")]
    assert files == ["inputs/trace.csv", "inputs/trace-2.csv", "inputs/trace-3.csv", "inputs/inputs-2.json"]


def test_files_of_formation_path_delays_and_rates_are_copied_and_fly_again(tmp_path):
    before = planning.make(loading.load("corridor", ["time.dt=0.05", "time.duration=0.5"])).world
    home = tmp_path / "home"
    home.mkdir()
    nodes = [
        {"id": n, "x": x, "y": y, "leader": n in before.formation.leaders}
        for n, (x, y) in enumerate(before.formation.nominal.tolist(), start=1)
    ]
    links = [{"source": one, "target": other} for one, other in before.formation.edges]
    (home / "swarm.json").write_text(json.dumps({"nodes": nodes, "links": links}))
    (home / "path.csv").write_text("time,x,y\n0,0,0\n0.5,1,0\n")
    rows = [f"0,{src},{dst},0.1,1e5" for src, dst in before.links.index]
    (home / "links.csv").write_text("time,src,dst,delay,rate\n" + "\n".join(rows) + "\n")
    (home / "file.toml").write_text("""
[formation]
file = "swarm.json"
[manoeuvre]
file = "path.csv"
[time]
dt = 0.05
duration = 0.5
[sensing]
sigma = 0.1
[agents]
estimator = "none"
law = "static"
[network]
profile = "t"
[network.profiles.t]
delay = { model = "trace", trace = { file = "links.csv" } }
rate = { trace = { file = "links.csv" } }
[record]
enabled = false
""")
    first = fly(planning.make(loading.load(str(home / "file.toml"))), "inprocess", tmp_path / "run", lambda *_: None)
    shutil.rmtree(home)
    again = planning.again(tmp_path / "run", (), verdicts=False)
    assert fly(again, "inprocess", tmp_path / "again", lambda *_: None).digest == first.digest
    kept = json.loads((tmp_path / "run" / "inputs" / "inputs.json").read_text())["originals"]
    assert sorted(kept) == ["links.csv", "path.csv", "swarm.json"]


def test_an_earlier_run_that_is_the_air_of_another_is_copied(tmp_path):
    lossy = loading.load("corridor", ["time.dt=0.05", "time.duration=0.5", "record.enabled=false"])
    fly(planning.make(lossy), "inprocess", tmp_path / "before", lambda *_: None)
    traced = [f'network.profiles.t.loss=[{{model="trace",file="{tmp_path}/before"}}]', 'network.profile="t"', "seed=3"]
    given = loading.load("corridor", ["time.dt=0.05", "time.duration=0.5", "network.availability=1.0", *traced])
    first = fly(planning.make(given), "inprocess", tmp_path / "run", lambda *_: None)
    shutil.rmtree(tmp_path / "before")
    again = planning.again(tmp_path / "run", (), verdicts=False)
    assert fly(again, "inprocess", tmp_path / "again", lambda *_: None).digest == first.digest


def test_a_run_under_the_verdicts_of_another_is_flown_again_under_them(tmp_path):
    """Before: its own replay let the models decide, and came to other bits."""
    given = loading.load("corridor", ["time.dt=0.05", "time.duration=0.5", "record.enabled=false"])
    fly(planning.make(given), "inprocess", tmp_path / "first", lambda *_: None)
    judged = planning.again(tmp_path / "first", ["seed=9"], verdicts=True)
    second = fly(judged, "inprocess", tmp_path / "second", lambda *_: None)
    shutil.rmtree(tmp_path / "first")
    again = planning.again(tmp_path / "second", (), verdicts=False)
    assert fly(again, "inprocess", tmp_path / "third", lambda *_: None).digest == second.digest


@pytest.mark.usefixtures("elsewhere")
def test_a_hunted_scenario_finds_the_estimator_of_the_hunt(tmp_path, capsys):
    file = field(tmp_path / "home")
    hunt = ["hunt", str(file), "--invariant", "bounded(1)", "--out", "smallest.toml"]
    assert commands.main(hunt) == 2
    said = capsys.readouterr().err
    assert f"--out smallest.toml: mine:Mine lies in {tmp_path}/home: write the file there" in said
