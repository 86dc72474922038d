"""Numbers of any size: refused in one line that names the key, or flown."""

import re
from contextlib import suppress
from dataclasses import fields
from importlib.metadata import entry_points
from math import inf, nan

import pytest
import tomli_w
from extremes import BASES, changed, numeric_fields, places
from flying import plan_of

from affinet.planning import making as planning
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError

BEYOND = [5e-324, 1e300, inf, nan, -(2**63), 10**30]
EXTREMES = [*BEYOND, 0, 0.0, -1, -1.0, 1e-300, 1.7e308, 2**63, 2**64, 1e-9, 1e9, 10**9]


@pytest.fixture
def file(tmp_path):
    return tmp_path / "extreme.toml"


def test_every_number_that_a_scenario_can_hold_is_tried():
    assert numeric_fields() == {field for base in BASES.values() for _, field in places(base)}


def flown_or_refused(file, raw, steps):
    file.write_text(tomli_w.dumps(raw))
    with suppress(PlanError):
        try:
            made = planning.make(loading.load(str(file)))
        except ScenarioError as error:
            (line,) = str(error).splitlines()
            assert any(step in line for step in steps if isinstance(step, str)), line
        else:
            rehearse(made)


def tried(file, name, values):
    """Every number that stands in this base, and in none before it."""
    before = {field for earlier in [*BASES][: [*BASES].index(name)] for _, field in places(BASES[earlier])}
    for steps, field in places(BASES[name]):
        for value in values if field not in before else ():
            flown_or_refused(file, changed(BASES[name], steps, value), steps)


@pytest.mark.parametrize("name", BASES)
def test_a_number_beyond_all_bounds_is_refused_in_one_line_that_names_its_key_or_flies(name, file):
    tried(file, name, BEYOND)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", BASES)
def test_any_number_is_refused_in_one_line_that_names_its_key_or_flies(name, file):
    tried(file, name, EXTREMES)


def flown_with(group, name):
    if name in ("target", "pursuit"):
        return BASES["target"]
    if name == "jor":
        return BASES["line-of-sight"]
    estimator, law = (name, "static") if group == "affinet.estimators" else ("rkf", name)
    bodies = "double-integrator" if law.startswith("double") else "single-integrator"
    return {**BASES["swarm"], "agents": {"estimator": estimator, "law": law}, "dynamics": {"model": bodies}}


def parameters():
    for group in ("affinet.estimators", "affinet.controllers"):
        for point in entry_points(group=group):
            algorithm = point.load()
            if not algorithm.__module__.startswith("agents."):
                continue
            for field in fields(algorithm):
                default = getattr(algorithm(), field.name)
                if not isinstance(default, str | bool):
                    yield pytest.param(group, point.name, field.name, default, id=f"{point.name}.{field.name}")


@pytest.mark.slow
@pytest.mark.parametrize(("group", "name", "parameter", "default"), [*parameters()])
def test_any_parameter_is_refused_in_one_line_that_names_its_key_or_flies(group, name, parameter, default, file):
    base = flown_with(group, name)
    for value in EXTREMES:
        said = [value, *default[1:]] if isinstance(default, list | tuple) else value
        agents = {**base["agents"], "parameters": {name: {parameter: said}}}
        flown_or_refused(file, {**base, "agents": agents}, (name, parameter))


FRAME = "{time=%s,theta=[[1,0],[0,1]],offset=[%s,0]}"
TIMES = f"manoeuvre={{keyframes=[{FRAME % (1.0, 0)},{FRAME % (1.0000000000000002, 1)}]}}"
SLOW_PROFILE = 'network={profile="slow",profiles={slow={delay={model="constant",mean=%s}}}}'
PIT = 'timeline=[{verb="cut",at=0,every=%s,lasts=%s,links=["1-2"]}]'


@pytest.mark.parametrize(
    ("name", "override", "words"),
    [
        pytest.param(
            "corridor",
            SLOW_PROFILE % "1e8",  # its ticks wrapped, and the message came at once
            "network.profiles.slow.delay.mean: 1e+08 s is longer than the run; give at most 60 s",
            id="a delay beyond the horizon",
        ),
        pytest.param(
            "corridor",
            SLOW_PROFILE % "1e300",  # wrapped
            "network.profiles.slow.delay.mean: should be less than or equal to 1000000000, got 1e+300",
            id="a delay beyond integers",
        ),
        pytest.param(
            "corridor",
            SLOW_PROFILE % "1e-9",  # passed as no delay at all
            "network.profiles.slow.delay.mean: 1e-09 s is nothing in ticks of 0.01 s; give 0, or at least 1e-08 s",
            id="a delay that ticks cannot tell from none",
        ),
        pytest.param(
            "corridor",
            'network={profile="slow",profiles={slow={rate={rate=1.0}}}}',  # its waits were as long as the age of the sun
            "network.profiles.slow.rate.rate: at 1 bit/s a message takes longer than the run of 60 s; give at least 13.0667",
            id="a rate at which nothing arrives",
        ),
        pytest.param(
            "corridor",
            "network.delay_ticks=6001",
            "network.delay_ticks: 6001 ticks, and the run has 6000: give fewer",
            id="a delay of more ticks than there are",
        ),
        pytest.param(
            "corridor",
            PIT % ("1e-6", "1e-6"),  # sixty million faults
            "timeline.1: every 1e-06 s is less than a tick of 0.01 s; give at least that",
            id="what comes back within a tick",
        ),
        pytest.param(
            "corridor",
            PIT % ("1.0", "0.001"),  # was never there
            "timeline.1: lasts no tick of 0.01 s; let it last at least that",
            id="what lasts no tick",
        ),
        pytest.param(
            "corridor",
            'timeline=[{verb="pause",at=0,every=0.01,lasts=0.01,agents=["all"]}]',  # hung for minutes
            "timeline.1: makes more than 10000 faults of the timeline; lengthen every, or give times",
            id="too many faults",
        ),
        pytest.param(
            "corridor",
            "sensing.sigma=1e-300",  # its square was 0
            "sensing.sigma: is too small to tell from 0: should be at least 1e-09, got 1e-300",
            id="a sigma whose square vanishes",
        ),
        pytest.param(
            "corridor",
            TIMES,  # as fast as numbers go
            "manoeuvre.keyframes.2.time: 1 s is less than a tick (0.01 s) after the one before; move it, or lower time.dt",
            id="keyframes within a tick",
        ),
        pytest.param(
            "corridor",
            'agents={estimator="rkf",law="static",parameters={static={alpha=1e300}}}',
            "agents.parameters.static.alpha: should be at most 1e+09 in size, got 1e+300",
            id="a gain beyond bounds",
        ),
        pytest.param(
            "corridor",
            'agents={estimator="rkf",law="static",parameters={rkf={sigma_w=-1.0}}}',  # passed
            "agents.parameters.rkf: sigma_w is a standard deviation, and at least 0, not -1",
            id="a negative standard deviation",
        ),
        pytest.param(
            "corridor",
            'agents={estimator="edge-kf",law="static",parameters={edge-kf={coefficients=[1.5]}}}',  # passed until a loss
            "agents.parameters.edge-kf: inputs with the coefficients [1.5] grow without end; give smaller ones",
            id="inputs that grow",
        ),
        pytest.param(
            "corridor",
            'timeline=[{verb="kill",at=0,agents=[-1]}]',  # KeyError: '-1'
            "timeline.1.agents: agent -1 does not exist: agents are 1 to 7",
            id="an agent below 1",
        ),
    ],
)
def test_what_cannot_fit_is_refused_with_its_bound(name, override, words):
    with pytest.raises(ScenarioError) as error:
        planning.make(loading.load(name, [override]))
    (line,) = str(error.value).splitlines()
    assert line.endswith(words)


@pytest.mark.parametrize(
    ("name", "overrides", "check", "words"),
    [
        pytest.param(
            "corridor",
            ["time.duration=1e8"],  # asked for 745 GiB, one array after the other
            "memory",
            "10000000000 ticks of 7 agents take ",
            id="a run that asks for terabytes",
        ),
        pytest.param(
            "rigid",
            ["time.dt=0.01", "agents.leader_gain=60", "agents.parameters.static.alpha=1.0"],  # could fly, then NaN
            "leader gain",
            "60 1/(s m2) is not below the bound 7.005 at dt 0.01 s (radius 16.13): leaders diverge; "
            "lower agents.leader_gain, or dt",
            id="leaders that keep their distances too hard",
        ),
        pytest.param(
            "corridor",
            ["agents.leader_gain=201"],  # could fly, then NaN
            "leader gain",
            "201 1/s is not below the bound 200 at dt 0.01 s (radius 1.01): leaders diverge; lower agents.leader_gain, or dt",
            id="pilots that pull too hard",
        ),
        pytest.param(
            "ravine",
            ["agents.leader_gain=101"],  # could fly, then NaN
            "leader gain",
            "101 1/s is not below the bound 100 at dt 0.01 s (radius 1.027): leaders diverge; lower agents.leader_gain, or dt",
            id="pilots of double integrators",
        ),
        pytest.param(
            "target",
            ["agents.parameters.pursuit.kappa=[1.0, 1001.0]"],  # could fly, then NaN
            "step",
            "radius 1.002 >= 1 at dt 0.002 s: the step is too long for kappa [1.0, 1001.0]; lower it, or dt",
            id="pursuers",
        ),
        pytest.param(
            "target",
            ["agents.parameters.target.gamma=[1.0, 1.0, 1000.0]"],  # could fly, then NaN
            "REDCHO",
            "gamma 1000 1/s is not below the bound 1000 at dt 0.002 s: REDCHO diverges; lower it, or dt",
            id="consensus that forgets too fast",
        ),
        pytest.param(
            "corridor",
            ['agents.estimator="conral"', "agents.parameters.conral.epsilon=-0.1"],  # flew, and diverged
            "consensus",
            "epsilon -0.1: nothing is agreed on; give one above 0, below 0.1783",
            id="consensus away from each other",
        ),
        pytest.param(
            "corridor",
            ['agents.estimator="silent-kf"', 'agents.law="static"', "agents.parameters.silent-kf.window=6000"],
            "window",
            "a window of 6000 ticks is never full in a run of 6000; give at most 5999",
            id="a window longer than the run",
        ),
    ],
)
def test_what_cannot_fly_is_found_before_it_does(name, overrides, check, words):
    with pytest.raises(PlanError) as error:
        planning.make(loading.load(name, overrides))
    (finding,) = (finding for finding in error.value.findings if finding.fatal)
    assert finding.check == check
    assert finding.says.startswith(words)


@pytest.mark.parametrize(("name", "gain"), [("corridor", 199.0), ("ravine", 99.0)])
def test_leaders_just_below_the_bound_fly(name, gain):
    made = planning.make(loading.load(name, [f"agents.leader_gain={gain}", "time.duration=1.0"]))
    assert rehearse(made).outcome.tracking_error["max"] < 1.5


def test_what_a_run_takes_of_the_memory_is_one_line_in_a_unit_that_fits():
    (fits,) = [found for found in plan_of("corridor", "time.duration=1").findings if found.check == "memory"]
    assert re.fullmatch(r"100 ticks of 7 agents take [1-9]\d{0,2}(\.\d+)? [KM]iB of memory; .* GiB", fits.says)
