"""What estimators and laws say they want, find and bring, a user's own like those that are shipped; nobody asks for names."""

import ast
import json
import re
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest
from flying import PROCESSES
from own_capabilities import CENTRALIZED, PILOTED
from own_code import LAW, broken, line_of, write

import affinet
from affinet.cli.commands import main
from affinet.planning import making
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from netem.processes.user_code import UserCodeError
from world.books.history import digest

SHORT = ("time.dt=0.05", "time.duration=1", "record.enabled=false")
STILL = ("agents.law=rest", *SHORT)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def plan_of(*overrides, name="corridor"):
    return making.make(loading.load(name, overrides))


def estimates(name, *given):
    parameters = [f'agents.parameters."{name}:Own"={{{", ".join(given)}}}'] if given else []
    return (f'agents.estimator="{name}:Own"', *parameters)


def steers(name, *given):
    parameters = [f'agents.parameters."{name}:Own"={{{", ".join(given)}}}'] if given else []
    return (f'agents.law="{name}:Own"', *parameters)


def refused(*overrides, name="corridor"):
    with pytest.raises((ScenarioError, PlanError, UserCodeError)) as caught:
        plan_of(*overrides, name=name)
    return caught.value


# ---- first-class citizens


@PROCESSES
@pytest.mark.parametrize("name", ["corridor", "ravine"])  # of single and of double integrators
def test_a_centralized_estimator_of_a_users_own_flies_in_both_runtimes_with_the_same_bits(name, folder):
    plan = plan_of(*estimates(write(folder, CENTRALIZED)), "network.availability=0.7", *SHORT, name=name)
    one, many = (fly(plan, runtime, folder / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert many.verdict == "pass", many.reasons
    assert one.digest == many.digest
    assert [process["role"] for process in many.processes].count("centre") == 1
    estimate = rehearse(plan).arrays["estimate"]
    assert np.abs(estimate).max() > 1.0  # the centre told of something


def test_with_the_filter_that_is_shipped_it_gives_the_bits_of_the_one_that_is_shipped(folder):
    own = estimates(write(folder, CENTRALIZED), 'filter="swarm"')
    air = ("agents.law=static", "network.availability=0.7", *SHORT)

    def digested(*overrides):
        arrays = rehearse(plan_of(*overrides, *air)).arrays
        return digest(
            {name: array for name, array in arrays.items() if name != "nis"}
        )  # which the own one does not report

    shipped = digested('agents.estimator="crkf"')
    assert digested(*own) == shipped
    assert digested(*own, f'agents.parameters.{own[0][17:]}.filter="own"') != shipped


@PROCESSES
@pytest.mark.parametrize("pull", ["pull=0.0", "pull=0.5"], ids=["mission", "mission and position"])
def test_a_law_of_a_users_own_that_flies_the_mission_does_so_in_both_runtimes(pull, folder):
    plan = plan_of(*steers(write(folder, PILOTED), pull), 'agents.estimator="none"', *SHORT)
    assert plan.told_mission.all()
    assert plan.positioned.all() == (pull == "pull=0.5")
    one, many = (fly(plan, runtime, folder / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert many.verdict == "pass", many.reasons
    assert one.digest == many.digest


def test_an_estimator_too_can_want_its_position(folder):
    wants = broken(
        CENTRALIZED,
        ("    def channels", "    wants = Wants(position=True)\n\n    def channels"),
        ("import numpy as np\n", "import numpy as np\n\nfrom affinet import Wants\n"),
        ("        told = heard", "        own.position + 1.0\n        told = heard"),
    )
    assert plan_of(*estimates(write(folder, wants)), *STILL).positioned.all()
    without = broken(wants, ("position=True", "position=False"))
    assert "unsupported operand type(s) for +: 'NoneType'" in str(refused(*estimates(write(folder, without)), *STILL))


# ---- findings


@pytest.mark.parametrize(
    ("text", "key", "given", "level", "says"),
    [
        (CENTRALIZED, "estimator", "gain=0.5", "note", "0.5 of 7 agents in 20 ticks"),
        (CENTRALIZED, "estimator", "gain=1.5", "error", "1.5 of 7 agents in 20 ticks"),
        (PILOTED, "law", "gain=2.0", "ok", "4 followers at 0.1"),
        (PILOTED, "law", "gain=21.0", "error", "4 followers at 1.05"),
    ],
    ids=["estimator", "estimator that is refused", "law", "law that is refused"],
)
def test_what_they_find_is_said_and_an_error_refuses_the_plan(text, key, given, level, says, folder, capsys):
    name = write(folder, text)
    settings = [*(estimates(name, given) if key == "estimator" else steers(name, given)), *SHORT]
    asked = [option for setting in settings for option in ("--set", setting)]
    status = main(["check", "corridor", "--json", *asked])
    checked = capsys.readouterr()
    report = json.loads(checked.out)
    check = "own gain" if key == "estimator" else "own step"
    assert {"check": check, "level": level, "says": says} in report["findings"]
    assert (status, report["flies"]) == ((2, False) if level == "error" else (0, True))
    if level == "error":
        assert f"{check}: {says}" in checked.err
        with pytest.raises(PlanError, match=re.escape(f"{check}: {says}")):
            plan_of(*settings)


def test_the_closed_loop_of_a_users_own_law_decides_whether_it_flies(folder):
    name = write(folder, PILOTED)
    says = {found.check: found.says for found in plan_of(*steers(name, "pull=0.5"), *SHORT).findings}
    assert re.match(r"radius 0\.9\d+ < 1 at dt 0\.05 s: settles to 1/e in ", says["step"])
    assert str(refused(*steers(name, "pull=50.0"), *SHORT)).startswith("step: radius 1.6")
    mute = write(folder, broken(PILOTED, ("def step_matrix", "def of_the_step")))
    said = [found for found in plan_of(*steers(mute), *SHORT).findings if found.check == "step"]
    assert [found.says for found in said] == [
        "Own brings no step_matrix (docs/laws.md): whether it settles with this step is not known"
    ]


# ---- what is wanted, and not given


@pytest.mark.parametrize("verb", ["kill", "pause"])
def test_with_a_centre_nobody_can_be_killed_or_paused(verb, folder):
    timeline = f'timeline=[{{verb="{verb}",at=0.1,agents=[3]}}]'
    said = str(refused(*estimates(write(folder, CENTRALIZED)), *STILL, timeline))
    assert "timeline: the centralized filter waits for every agent in every tick" in said


WANTING = (
    ("    by_stress", "    wants = Wants(WHAT=True)\n    by_stress"),
    ("import numpy as np\n", "import numpy as np\n\nfrom affinet import Wants\n"),
)


@pytest.mark.parametrize(
    ("what", "given", "says"),
    [
        ("synchronous", 'time.exchange="next-tick"', "time.exchange: NAME:Own wants to hear in a tick what is said in"),
        ("synchronous", "network.delay_ticks=2", "network.delay_ticks: NAME:Own wants to hear in a tick what is said"),
        ("everybody", 'timeline=[{verb="kill",at=0.1,agents=[3]}]', "timeline: NAME:Own wants everybody there in"),
        ("everybody", 'timeline=[{verb="pause",at=0.1,agents=[3]}]', "timeline: NAME:Own wants everybody there in"),
    ],
)
def test_what_a_law_wants_and_a_scenario_does_not_give_refuses_the_scenario(what, given, says, folder):
    wanting = [(old, new.replace("WHAT", what)) for old, new in WANTING]
    name = write(folder, broken(LAW, *wanting))
    assert says.replace("NAME", name) in str(refused(*steers(name), *SHORT, given))
    assert plan_of(*steers(name), *SHORT)
    assert plan_of(*steers(write(folder, LAW)), *SHORT, given)


# ---- what they say wrongly

FOUND = 'return [Finding("own gain", level, '
SAID_WRONGLY = [
    (
        "law",
        "return Wants(mission=True, position=self.pull > 0.0)",
        "return True, False",
        "Own.wants: must be a Wants, got a tu",
    ),
    ("law", "mission=True", "mission=1", "Own.wants: wants 'mission' or not, True or False, got 1"),
    # An AttributeError within must not pass for having nothing to say.
    ("law", "mission=True", "mission=self.gian", "Own.wants: AttributeError: 'Own' object has no attribute 'gian'"),
    (
        "law",
        "    def checks(self, swarm)",
        "    def checks(self)",
        "Own.checks: TypeError: Own.checks() takes 1 positional",
    ),
    ("law", "return [Finding", "1 / 0; return [Finding", "Own.checks: ZeroDivisionError: division by zero"),
    (
        "law",
        '"own step", level',
        '"own step", "fatal"',
        "Own.checks: a Finding has level 'ok', 'note', 'error', not 'fatal'",
    ),
    (
        "law",
        "return np.eye(len(stress)) *",
        "return stress[0]; return np.eye(7) *",
        "Own.step_matrix: the step must be float64 (..., S, S)",
    ),
    ("law", "(1.0 - dt", "(np.nan - dt", "Own.step_matrix: the step has numbers that are not finite"),
    ("estimator", FOUND, f"return None and {FOUND[7:]}", "Own.checks: must return a list of Findings, got None"),
    ("estimator", FOUND, f"return ['no', {FOUND[8:]}", "Own.checks: must return a list of Findings, got one of a str"),
    (
        "estimator",
        "level, f",
        "level, 7 or f",
        "Own.checks: a Finding says what was checked and found in texts, got 'own g",
    ),
    (
        "estimator",
        "return SwarmFilter",
        "return 7 or SwarmFilter",
        "Own.centre: must return a Centre, or None, got an int",
    ),
    (
        "estimator",
        "return Places(np",
        "return list(np",
        "Blended.begin: the state must be a NamedTuple of arrays that beg",
    ),
    (
        "estimator",
        "return Places(position), estimate",
        "return state, relative",
        "Blended.step: must return a CentreEstimate",
    ),
    (
        "estimator",
        "return Places(position), e",
        "return None, e",
        "Blended.step: the state must be a Places, as before, got",
    ),
    (
        "estimator",
        "CentreEstimate(relative, np",
        "CentreEstimate(relative[0], np",
        "Blended.step: relative must be float64",
    ),
]


@pytest.mark.parametrize(("key", "old", "new", "says"), SAID_WRONGLY, ids=[new for _, _, new, _ in SAID_WRONGLY])
def test_what_they_say_wrongly_names_class_file_and_line(key, old, new, says, folder):
    text = broken(CENTRALIZED if key == "estimator" else PILOTED, (old, new))
    name = write(folder, text)
    which = "swarm" if "SwarmFilter" in old else "own"
    chosen = (*estimates(name, f'filter="{which}"'), *STILL) if key == "estimator" else (*steers(name), *SHORT)
    said = str(refused(*chosen))
    assert said.startswith(f"{name}:{says}")
    assert f"{folder / name}.py:" in said


PREDICTED = "        position = state.position +"
LATE = (PREDICTED, f"        1 / 0 if state.position.any() else 0\n{PREDICTED}")


@PROCESSES
def test_a_centre_that_fails_in_flight_is_said_alike_in_both_runtimes(folder, capsys):
    text = broken(CENTRALIZED, LATE)
    name = write(folder, text)
    asked = [option for setting in (*estimates(name), *STILL) for option in ("--set", setting)]
    reasons = []
    for runtime in ("inprocess", "processes"):
        assert main(["run", "corridor", "--json", "--runtime", runtime, "--out", str(folder / runtime), *asked]) == 3
        reasons += json.loads(capsys.readouterr().out)["reasons"]
    line = line_of(text, "1 / 0")
    here = f"{name}:Blended.step in tick 1: ZeroDivisionError: division by zero ({folder / name}.py:{line})"
    assert reasons == [here, f"centre: {here}"]


# ---- nobody asks for names

ROOT = Path(affinet.__file__).parents[1]
SHARED = {"agents.estimators.base", "agents.laws.base", "agents.laws.leaders"}
SHIPPED = [point for group in ("affinet.estimators", "affinet.controllers") for point in entry_points(group=group)]


def named(source):
    """Modules of estimators and laws that a source imports or says, and classes that it names from there."""
    modules = {point.module for point in SHIPPED} - SHARED
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)} & modules
        elif isinstance(node, ast.Import):
            yield from {alias.name for alias in node.names} & modules
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from (module for module in modules if node.value.startswith(module))


def test_no_room_but_their_own_names_an_estimator_or_a_law():
    files = [
        file for room in ("affinet", "agents", "world", "netem", "analysis") for file in (ROOT / room).rglob("*.py")
    ]
    own = (ROOT / "agents" / "estimators", ROOT / "agents" / "laws")
    face = ROOT / "affinet" / "__init__.py"  # offers what a user's own centre is made of, and decides nothing
    others = [file for file in files if file.parent not in own and file != face]
    assert len(others) > 200
    assert {str(file): found for file in others if (found := [*named(file.read_text())])} == {}


@pytest.mark.parametrize(
    "source",
    [
        "from agents.estimators.jor import JacobiOverRelaxation",
        "from agents.laws import base, single",
        "import agents.estimators.centralized as filters",
        "load('agents.laws.pursuit:Pursuit', None)",
    ],
)
def test_it_would_be_noticed(source):
    assert [*named(source)]
