"""The scenario file: what is written flies; what is wrong is one line: where, which key, what would be right."""

from importlib.metadata import entry_points

import numpy as np
import pytest

from affinet.planning import making
from affinet.scenario import loading, selectors, verbs
from affinet.scenario.wrong import ScenarioError
from netem.core.links import Links
from netem.faults.fault import Fault, UnderWay, Verb
from world.formation.nominal import PRESETS

ESTIMATORS = f"there are {', '.join(sorted(entry_points(group='affinet.estimators').names))}"

GOOD = """\
description = "a test"
seed = 1

[formation]
preset = "zhao7"

[manoeuvre]
keyframes = [
    { time = 0.0, theta = [[1.0, 0.0], [0.0, 1.0]], offset = [0.0, 0.0] },
    { time = 1.0, theta = [[1.0, 0.0], [0.0, 1.0]], offset = [1.0, 0.0] },
]

[time]
dt = 0.01
duration = 1.0

[sensing]
sigma = 0.1

[agents]
estimator = "rkf"
law = "static"

[agents.parameters.rkf]
sigma_w = 0.5

[network]
availability = 0.7
coupled = true

[[network.links]]
links = "1->2"
availability = 0.5
delay_ticks = 3

[[timeline]]
verb = "cut"
at = 0.1
until = 0.3
links = ["2->4", "1-2"]

[[timeline]]
verb = "kill"
at = 0.4
agents = [5]

[[timeline]]
verb = "restart"
at = 0.5
agents = [5]
"""

OWN = """\
nodes = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
edges = ["1-2", "1-3", "1-4", "2-3", "2-4", "3-4"]
leaders = [1, 2, 3]
"""


@pytest.fixture
def file(tmp_path):
    return tmp_path / "bad.toml"


# ---- what is written is what flies


@pytest.mark.parametrize("name", loading.shipped())
def test_every_shipped_scenario_loads_and_can_fly(name):
    made = making.make(loading.load(name))
    assert made.scenario.description
    assert not any(finding.fatal for finding in made.findings)


def test_five_scenarios_are_shipped():
    assert {"corridor", "hexa", "partition", "ravine", "switching"} <= set(loading.shipped())


def test_a_scenario_flies_as_it_is_written(file):
    file.write_text(GOOD)
    made = making.make(loading.load(str(file)))
    links = made.world.links
    row = links.index[1, 2]
    assert (made.world.dt, made.world.ticks, made.world.seed) == (0.01, 100, 1)
    assert made.estimator.build().sigma_w == 0.5
    (air,) = made.profiles
    (layer,), (delay,) = air.chains, air.delays
    other = np.arange(len(links)) != row
    assert layer.loss[row, 0] == 0.5
    assert layer.loss[other, 0] == pytest.approx(0.3)
    assert (delay.mean, delay.rows.tolist()) == (pytest.approx(0.03), (~other).tolist())
    assert air.coupled
    assert made.faults == (
        Fault(Verb.CUT, 10, 30, pairs=((2, 4), (2, 1), (1, 2))),
        Fault(Verb.KILL, 40, 50, agents=(5,)),
    )


def test_the_faults_of_the_network_fly_as_they_are_written(file):
    more = """
        [[timeline]]
        verb = "cut"
        at = 0.6
        links = ["1->2"]
        in_flight = "hold"

        [[timeline]]
        verb = "partition"
        at = 0.6
        until = 0.7
        groups = [[1, 2], [3]]
        in_flight = "deliver"

        [[timeline]]
        verb = "lose"
        at = 0.2
        links = ["4->2"]
        loss = 0.25
    """
    file.write_text(GOOD + more)
    assert making.make(loading.load(str(file))).faults[2:] == (
        Fault(Verb.CUT, 60, None, pairs=((1, 2),), under_way=UnderWay.HOLD),
        Fault(Verb.PARTITION, 60, 70, groups=((1, 2), (3,)), under_way=UnderWay.DELIVER),
        Fault(Verb.LOSE, 20, None, pairs=((4, 2),), probability=0.25),
    )


def test_a_formation_of_ones_own_flies(file):
    file.write_text(GOOD.replace('preset = "zhao7"\n', OWN).replace("agents = [5]", "agents = [4]"))
    formation = making.make(loading.load(str(file))).world.formation
    assert formation.nominal.tolist() == [[0, 0], [1, 0], [0, 1], [1, 1]]
    assert formation.edges == ((1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4))
    assert formation.leaders == (1, 2, 3)


@pytest.mark.parametrize(("exchange", "least"), [("same-tick", 0), ("next-tick", 1)])
def test_next_tick_exchange_delays_every_message_by_a_tick(file, exchange, least):
    file.write_text(GOOD)
    (air,) = making.make(loading.load(str(file), [f"time.exchange={exchange}"])).profiles
    assert air.least_delay == least


def test_an_agent_that_was_killed_twice_comes_back_at_its_restart(file):
    file.write_text(
        GOOD.replace(
            'verb = "cut"\nat = 0.1\nuntil = 0.3\nlinks = ["2->4", "1-2"]', 'verb = "kill"\nat = 0.1\nagents = [5]'
        )
    )
    timeline = making.make(loading.load(str(file))).timeline
    assert timeline.at(45).dead[4]
    assert not timeline.at(50).dead[4]


FORMATION = PRESETS["zhao7"]
LINKS = Links.both_ways(FORMATION.agents, FORMATION.edges)
LEADERS = (1, 2, 3)


def between(sources, receivers):
    return [(src, dst) for src, dst in LINKS.index if src in sources and dst in receivers]


FOLLOWERS = (4, 5, 6, 7)


@pytest.mark.parametrize(
    ("selector", "pairs"),
    [
        ("2->4", [(2, 4)]),
        ("2-4", [(4, 2), (2, 4)]),
        ("4-2", [(4, 2), (2, 4)]),
        ("all", list(LINKS.index)),
        ("leaders", [pair for pair in LINKS.index if set(pair) & set(LEADERS)]),
        ("6", [(src, dst) for src, dst in LINKS.index if 6 in (src, dst)]),
        ("6->all", [(src, dst) for src, dst in LINKS.index if src == 6]),
        ("leaders->followers", between(LEADERS, FOLLOWERS)),
        (
            "leaders-followers",
            [pair for pair in LINKS.index if pair in between(LEADERS, FOLLOWERS) + between(FOLLOWERS, LEADERS)],
        ),
        ("followers->followers", between(FOLLOWERS, FOLLOWERS)),
    ],
)
def test_links_are_selected_one_way_or_both_ways_by_agents_or_by_roles(selector, pairs):
    assert [*selectors.pairs([selector], FORMATION, LINKS)] == pairs
    assert 0 < len(pairs) <= len(LINKS)


def test_links_that_are_selected_twice_are_selected_once():
    assert selectors.pairs(["2-4", "2->4", "1->2"], FORMATION, LINKS) == ((4, 2), (2, 4), (1, 2))


LINKED = [verb for verb, model in verbs.VERBS.items() if "links" in model.model_fields]
NEEDS = {"lose": "loss=0.5", "delay": "delay=0.02", "degrade": 'profile="wifi_clear"', "bias": "by=[0.1, 0.0]"}
NEEDS |= {"outlier": "p=0.5\nsigma=1.0"}


@pytest.mark.parametrize("verb", LINKED)
@pytest.mark.parametrize("word", ["all", "leaders->followers", "2->4"])
def test_a_selector_of_links_alone_is_a_list_of_one(verb, word, file):
    flown = []
    for links in (f'"{word}"', f'["{word}"]'):
        file.write_text(f"{GOOD}[[timeline]]\nverb='{verb}'\nat=0.6\nlinks={links}\n{NEEDS.get(verb, '')}\n")
        plan = making.make(loading.load(str(file)))
        flown.append((plan.timeline.scripted, plan.scenario.timeline[-1]))
    assert flown[0] == flown[1]
    assert flown[0][1].links == [word]


def test_the_word_all_selects_links_wherever_they_are_selected(file):
    everywhere = """[[network.zones]]\ncentre=[0.0, 0.0]\nradius=3.0\nlinks="all"\n
        [[network.links]]\nlinks="all"\navailability=0.4\n"""
    file.write_text(GOOD.replace('["2->4", "1-2"]', '"all"').replace("[[timeline]]", f"{everywhere}\n[[timeline]]", 1))
    plan = making.make(loading.load(str(file)))
    assert set(plan.timeline.scripted[0].pairs) == set(LINKS.index)


@pytest.mark.parametrize("selector", ["2=4", "2<-4", "2 -> 4", "a->b", "2->", "2--4", "", "2->4->5", "leader"])
def test_what_selects_no_links_is_refused_with_the_ways_to_write_it(selector):
    with pytest.raises(
        ValueError,
        match=rf"{selector!r} selects no links; (did you mean 'leaders'\? )?write '2->4' .*, '2-4' .*'leaders->followers'",
    ):
        selectors.check(selector)


@pytest.mark.parametrize(
    ("selector", "match"),
    [
        ("1->7", "'1->7' matches no link of the formation"),
        ("2->2", "'2->2' matches no link of the formation"),
        ("1->8", "agent 8 does not exist: agents are 1 to 7"),
        ("0", "agent 0 does not exist: agents are 1 to 7"),
    ],
)
def test_a_selector_that_matches_nothing_is_refused(selector, match):
    with pytest.raises(ValueError, match=match):
        selectors.pairs([selector], FORMATION, LINKS)


# ---- --set


@pytest.mark.parametrize(
    ("override", "section", "key", "value"),
    [
        ("network.availability=0.5", "network", "availability", 0.5),
        ("network.availability=1", "network", "availability", 1.0),
        ("network.coupled=false", "network", "coupled", False),
        ("network.delay_ticks=2", "network", "delay_ticks", 2),
        ("agents.estimator=ral", "agents", "estimator", "ral"),
        ('agents.estimator="ral"', "agents", "estimator", "ral"),
        ("agents.parameters.static.alpha=5", "agents", "parameters", {"rkf": {"sigma_w": 0.5}, "static": {"alpha": 5}}),
        ("formation.leaders=[1, 2, 4]", "formation", "leaders", [1, 2, 4]),
        ("dynamics.disturbance=0.01", "dynamics", "disturbance", 0.01),
        (" time.duration = 2 ", "time", "duration", 2.0),
    ],
)
def test_set_overrides_a_key_with_a_value_of_its_type(file, override, section, key, value):
    file.write_text(GOOD)
    given = getattr(getattr(loading.load(str(file), [override]), section), key)
    assert given == value
    assert type(given) is type(value)


def test_set_overrides_a_shipped_scenario_and_leaves_the_rest():
    before, after = loading.load("corridor"), loading.load("corridor", ["seed=7"])
    assert after.seed == 7
    assert after.model_dump() == before.model_dump() | {"seed": 7}


def test_of_two_overrides_of_one_key_the_last_holds(file):
    file.write_text(GOOD)
    assert loading.load(str(file), ["seed=7", "seed=8"]).seed == 8


WRONG_OVERRIDES = [
    ("network.availability=1.3", "network.availability", "less than or equal to 1, got 1.3"),
    ("network.availabilty=0.5", "network.availabilty", "did you mean 'availability'?"),
    ("netwrk.availability=0.5", "netwrk", "did you mean 'network'?"),
    ("time.dt=fast", "time.dt", "should be a number, like "),
    ('time.dt="0.01"', "time.dt", "should be a number, like "),
    ("seed=", "seed", "should be a whole number, like 1, got "),
    ("time.dt=0.007", "time", "duration 1 s is not a whole number of ticks of 0.007 s"),
    ("formation.preset=zhao8", "formation", "there are zhao7, hexa10, octa10"),
    ("agents.estimator=kalman", "agents.estimator", ESTIMATORS),
    ("agents.parameters.rkf.sigma=1", "agents.parameters.rkf.sigma", "rkf has sigma_w"),
    ("formation.leaders=[1, 2, 9]", "formation.leaders", "agents are 1 to 7"),
    ("network.availability", "network.availability", "write it as key=value, like network.availability=0.5"),
    ("=3", "=3", "write it as key=value"),
    ("network.=3", "network.=3", "write it as key=value"),
    ("time.dt.x=3", "time.dt.x=3", "dt is not a table"),
    # The second line was read as another key, and dropped.
    ("seed=1\nnetwork.availability=7", "seed=1", "it says more than one value; give each key an override of its own"),
    ("seed=1\n[network]\navailability=7", "seed=1", "it says more than one value"),
    ("description=\udcff", "description=", "not UTF-8, as TOML must be"),
    ("timeline.1.at=3", "timeline.1.at=3", "timeline is not a table"),
]


@pytest.mark.parametrize(("override", "key", "remedy"), WRONG_OVERRIDES, ids=[row[0] for row in WRONG_OVERRIDES])
def test_a_wrong_override_is_one_line_that_says_so_the_key_and_what_would_be_right(file, override, key, remedy):
    file.write_text(GOOD)
    with pytest.raises(ScenarioError) as error:
        making.make(loading.load(str(file), [override]))
    (line,) = str(error.value).splitlines()
    assert line.startswith("override")
    assert key in line
    assert remedy in line


# ---- what is wrong in a file


VERBS = (
    "cut, partition, lose, delay, degrade, heal, kill, restart, pause, resume, clock, depart, rejoin, "
    "replace, gust, bias, outlier, dropout, freeze, lie"
)
ONE_OF = "give sigma (m), or covariance (m2), or sigma_range (m) and sigma_bearing (rad)"
WRONG = [
    # keys
    ("availability = 0.7", "availabilty = 0.7", "network.availabilty", "did you mean 'availability'? known here: "),
    ("seed = 1", "sede = 1", "sede", "did you mean 'seed'?"),
    ("[network]", "[netwrok]", "netwrok", "did you mean 'network'?"),
    ("until = 0.3", "untill = 0.3", "timeline.1.untill", "did you mean 'until'?"),
    ("delay_ticks = 3", "delay = 3", "network.links.1.delay", "did you mean 'delay_ticks'?"),
    (
        "at = 0.4\n",
        "at = 0.4\nuntil = 0.5\n",
        "timeline.2.until",
        "known here: after, agents, at, every, name, times, verb, when",
    ),
    ("dt = 0.01\n", "", "time.dt", "is missing; it has no default"),
    # types
    ("dt = 0.01", 'dt = "fast"', "time.dt", "should be a number, like "),
    ("dt = 0.01", 'dt = "0.01"', "time.dt", "should be a number, like "),
    ("duration = 1.0", "duration = true", "time.duration", "should be a number, like "),
    ("seed = 1", "seed = 1.5", "seed", "should be a whole number, like 1, got "),
    ("seed = 1", "seed = true", "seed", "should be a whole number, like 1, got "),
    ("coupled = true", 'coupled = "yes"', "network.coupled", "should be true or false"),
    ("description = ", "description = 3 #", "description", 'should be text in quotes, like "what it is about", got 3'),
    ("agents = [5]\n\n[", "agents = 5\n\n[", "timeline.2.agents", 'should be a list, like [4, "leaders"], got 5'),
    # values
    ("availability = 0.7", "availability = 1.3", "network.availability", "less than or equal to 1, got 1.3"),
    ("availability = 0.7", "availability = -0.1", "network.availability", "greater than or equal to 0, got -0.1"),
    ("availability = 0.5", "availability = 2", "network.links.1.availability", "less than or equal to 1, got 2"),
    ("delay_ticks = 3", "delay_ticks = -1", "network.links.1.delay_ticks", "greater than or equal to 0, got -1"),
    ("seed = 1", "seed = -1", "seed", "greater than or equal to 0, got -1"),
    # time
    ("dt = 0.01", "dt = 0", "time.dt", "greater than 0, got 0"),
    ("dt = 0.01", "dt = inf", "time.dt", "finite number, got inf"),
    ("duration = 1.0", "duration = 1.005", "time", "1.005 s is not a whole number of ticks of 0.01 s"),
    # formation
    (
        'preset = "zhao7"',
        'preset = "zhao8"',
        "formation",
        "no preset 'zhao8'; did you mean 'zhao7'? there are zhao7, hexa10, octa10",
    ),
    ('preset = "zhao7"', f'preset = "zhao7"\n{OWN}', "formation", "give a preset, or nodes and edges, not both"),
    ('preset = "zhao7"', "scale = 2.0", "formation", "give a preset, or nodes, edges and leaders"),
    ('preset = "zhao7"', OWN.replace("[1.0, 1.0]]", "[nan, 1.0]]"), "formation.nodes.4.1", "finite number"),
    ('preset = "zhao7"', OWN.replace("[1.0, 1.0]]", "[1.0]]"), "formation", "nodes need two coordinates each"),
    (
        'preset = "zhao7"',
        OWN.replace("3-4", "3=4"),
        "formation.edges.6",
        "'3=4' is no edge; the edges of a formation have no direction",
    ),
    ('preset = "zhao7"', OWN.replace("3-4", "3-9"), "formation.edges", "no agents [9]; agents are 1 to 4"),
    ('preset = "zhao7"', 'preset = "zhao7"\nleaders = [1, 2, 9]', "formation.leaders", "agents are 1 to 7"),
    # manoeuvre
    ("{ time = 1.0,", "{ time = 0.0,", "manoeuvre", "keyframe times must increase, got [0.0, 0.0]"),
    (
        "[manoeuvre]",
        '[manoeuvre]\npreset = "hover"',
        "manoeuvre",
        "give a preset ('hover', 'corridor', 'ravine'), or keyframes",
    ),
    ("offset = [1.0, 0.0]", "offset = [1.0]", "manoeuvre.keyframes.2.offset", "must be 2 numbers"),
    ("1.0]], offset = [1", "1.0, 2.0]], offset = [1", "manoeuvre.keyframes.2.theta", "must be 2 x 2 numbers"),
    # sensing
    ("sigma = 0.1", "", "sensing", ONE_OF),
    ("sigma = 0.1", "sigma_range = 0.1", "sensing", "sigma_range (m) and sigma_bearing (rad) go together"),
    ("sigma = 0.1", "sigma_bearing = 0.1", "sensing", "sigma_range (m) and sigma_bearing (rad) go together"),
    ("sigma = 0.1", "sigma = 0.1\nsigma_range = 0.1\nsigma_bearing = 0.1", "sensing", ONE_OF),
    (
        "sigma = 0.1",
        "covariance = [[1.0, 0.0], [0.0, 1.0]]\nsigma_range = 0.1\nsigma_bearing = 0.1",
        "sensing",
        ONE_OF,
    ),
    ("sigma = 0.1", "sigma_range = 0.0\nsigma_bearing = 0.1", "sensing.sigma_range", "greater than 0"),
    ("sigma = 0.1", "sigma_range = 0.1\nsigma_bearing = 0.0", "sensing.sigma_bearing", "greater than 0"),
    (
        'sigma = 0.1\n\n[agents]\nestimator = "rkf"',
        'sigma_range = 0.1\nsigma_bearing = 0.1\n\n[agents]\nestimator = "ga-rkf"',
        "agents",
        "choose another, or a sensor of coordinates",
    ),
    ("sigma = 0.1", "sigma = 0.0", "sensing", "give a small one, like 1e-6 m"),
    (
        "sigma = 0.1",
        "covariance = [[1.0, 2.0], [2.0, 1.0]]",
        "sensing.covariance",
        "must be symmetric and positive definite, in m2",
    ),
    ("sigma = 0.1", "sigma = 0.1\nsamples = 0", "sensing.samples", "greater than or equal to 1"),
    # dynamics
    (
        "[agents]",
        "[dynamics]\ndisturbance = 0.1\ncovariance = [[1.0, 0.0], [0.0, 1.0]]\n[agents]",
        "dynamics",
        "not both",
    ),
    (
        "[agents]",
        "[dynamics]\ncovariance = [[1.0, 2.0], [2.0, 1.0]]\n[agents]",
        "dynamics.covariance",
        "must be symmetric and positive definite, in m2",
    ),
    ("[agents]", "[dynamics]\npersistence = 1.0\n[agents]", "dynamics.persistence", "less than 1"),
    ("[agents]", "[dynamics]\nkernel = {}\n[agents]", "dynamics.kernel.length", "is missing"),
    ("[agents]", "[dynamics]\nkernel = { length = 0.0 }\n[agents]", "dynamics.kernel.length", "greater than 0"),
    # agents
    (
        '"static"\n',
        '"double-constant-velocity"\nleaders = "distances"\n',
        "agents.leaders",
        "double integrators have 'pilot'",
    ),
    (
        '"rkf"',
        '"kalman"',
        "agents.estimator",
        f"no 'kalman'; {ESTIMATORS}, or give 'module:Class'",
    ),
    ('"rkf"', '"no.such:Thing"', "agents.estimator", "cannot load no.such:Thing"),
    (
        '"static"',
        '"statik"',
        "agents.law",
        "no 'statik'; did you mean 'static'? there are constant-velocity, double-constant-velocity, double-varying-velocity, "
        "pursuit, rest, static, varying-velocity",
    ),
    ("sigma_w = 0.5", "sigma = 0.5", "agents.parameters.rkf.sigma", "rkf has sigma_w, prior_position"),
    ("sigma_w = 0.5", 'sigma_w = "much"', "agents.parameters.rkf.sigma_w", "should be a number, like "),
    ("[agents.parameters.rkf]", "[agents.parameters.rfk]", "agents.parameters.rfk", "rkf"),
    # network and timeline
    ('links = "1->2"', 'links = "1=2"', "network.links.1.links", "'1=2' selects no links; write '2->4'"),
    ('links = "1->2"', 'links = "1->7"', "network.links.1.links", "'1->7' matches no link of the formation"),
    ('links = "1->2"', 'links = "1->9"', "network.links.1.links", "agent 9 does not exist: agents are 1 to 7"),
    ('links = "1->2"', 'links = "1->2"\nchannels = "comms"', "network", "coupled = true gives sensing and comms one"),
    ('"1-2"]', '"1~2"]', "timeline.1.links.2", "'1~2' selects no links; write '2->4'"),
    ('["2->4", "1-2"]', '"1~2"', "timeline.1.links.1", "'1~2' selects no links; write '2->4'"),
    ('"1-2"]', '"1-7"]', "timeline.1.links", "'1-7' matches no link of the formation"),
    (
        '"1-2"]',
        '"1-2"]\nin_flight = "keep"',
        "timeline.1.in_flight",
        "should be 'drop', 'deliver' or 'hold', got \"keep\"",
    ),
    ('verb = "cut"', 'verb = "lose"', "timeline.1.loss", "is missing; it has no default"),
    ('verb = "cut"', 'verb = "lose"\nloss = 1.5', "timeline.1.loss", "less than or equal to 1, got 1.5"),
    (
        'verb = "cut"',
        'verb = "lose"\nloss = 1.0\nin_flight = "hold"',
        "timeline.1.in_flight",
        "known here: after, at, every, lasts, links, loss, ",
    ),
    ("until = 0.3", "until = 0.05", "timeline.1", "ends at 0.05 s, but begins at 0.1 s; until must be later"),
    (
        'verb = "kill"',
        'verb = "depart"',
        "timeline.3",
        "agent 5 is under no kill then, in the same frame of time, that this could end",
    ),
    ("at = 0.5", "at = 0.4", "timeline.3", "agent 5 is under no kill then"),
    (
        'verb = "kill"',
        'verb = "explode"',
        "timeline.2",
        f"needs a verb among {VERBS}",
    ),
    ('verb = "kill"\n', "", "timeline.2", f"needs a verb among {VERBS}"),
    ("agents = [5]", "agents = [9]", "timeline.2.agents", "agent 9 does not exist: agents are 1 to 7"),
    ('links = ["2->4", "1-2"]', "links = []", "timeline.1.links", "at least 1 item"),
    (
        'verb = "kill"\nat = 0.4\nagents = [5]\n\n[[timeline]]\nverb = "restart"\nat = 0.5\nagents = [5]',
        'verb = "partition"\nat = 0.4\ngroups = [[1, 2], [2, 3]]',
        "timeline.2",
        "agent 2 stands in two groups",
    ),
]


@pytest.mark.parametrize(("good", "bad", "key", "remedy"), WRONG, ids=[f"{key}: {remedy}" for *_, key, remedy in WRONG])
def test_what_is_wrong_in_a_file_is_one_line_that_says_the_file_the_key_and_what_would_be_right(
    file, good, bad, key, remedy
):
    assert good in GOOD
    file.write_text(GOOD.replace(good, bad))
    with pytest.raises(ScenarioError) as error:
        making.make(loading.load(str(file)))
    (line,) = str(error.value).splitlines()
    assert line.startswith("bad.toml:")
    assert f" {key}: " in line
    assert remedy in line


@pytest.mark.parametrize(
    ("good", "bad", "number"),
    [
        ("seed = 1", "seed = -1", 2),
        ("dt = 0.01", "dt = 0", 14),
        ("duration = 1.0", "duration = 1.005", 13),  # the table, for duration and dt do not fit together
        ("delay_ticks = 3", "delay_ticks = -1", 34),
        ("at = 0.1", "at = -0.1", 38),
        ("at = 0.4", "at = -0.4", 44),
        ("at = 0.5", "at = -0.5", 49),
    ],
)
def test_what_is_wrong_is_named_by_its_line(file, good, bad, number):
    file.write_text(GOOD.replace(good, bad))
    with pytest.raises(ScenarioError, match=rf"^bad\.toml:{number}: "):
        loading.load(str(file))


def test_of_several_mistakes_the_first_is_told_and_the_others_are_named_with_their_lines(file):
    file.write_text(GOOD.replace("seed = 1", "seed = -1").replace("dt = 0.01", "dt = 0"))
    with pytest.raises(ScenarioError) as error:
        loading.load(str(file))
    assert str(error.value) == (
        "bad.toml:2: seed: should be greater than or equal to 0, got -1; at least 1 more mistake: time.dt (bad.toml:14)"
    )


def test_a_file_that_is_no_toml_is_named_with_the_place(file):
    file.write_text("seed = 1\ndt 0.01\n")
    with pytest.raises(ScenarioError, match=r"^bad\.toml:2: not TOML: .*, at column 4$"):
        loading.load(str(file))


def test_a_file_that_is_no_text_is_named(file):
    file.write_bytes(b'description = "\xff"\n')
    with pytest.raises(ScenarioError, match=r"^bad\.toml: "):
        loading.load(str(file))


@pytest.mark.parametrize("name", ["nowhere.toml", "coridor"])
def test_a_scenario_that_does_not_exist_is_refused_with_those_that_are_shipped(name):
    with pytest.raises(
        ScenarioError,
        match=rf"^{name}: no such file, and no such scenario; (did you mean 'corridor'\? )?shipped are bursts, corridor, ",
    ):
        loading.load(name)


SENSORS = [
    ("sensing.covariance=[[0.01, 0.0], [0.0, 0.02]]",),
    ("sensing.sigma_range=0.1", "sensing.sigma_bearing=0.2"),
    ("sensing.sigma_along=0.1", "sensing.sigma_across=0.2"),
    ("sensing.sigma_direction=0.1",),
    ("sensing.sigma=0.3",),
]


@pytest.mark.parametrize("overrides", SENSORS, ids=lambda overrides: overrides[0].partition("=")[0])
def test_another_sensor_stands_in_place_of_that_of_the_file(overrides):
    """Before: refused, as two sensors, with no word of which had been given."""
    given = loading.load("corridor", overrides).sensing.model_dump(exclude_none=True)
    assert given.keys() - {"samples"} == {one.partition("=")[0].removeprefix("sensing.") for one in overrides}


def test_two_sensors_in_a_file_are_named():
    with pytest.raises(ScenarioError, match=r"one of them, where sigma and covariance are given$"):
        loading.load("corridor", ("sensing={ sigma = 0.1, covariance = [[1.0, 0.0], [0.0, 1.0]] }",))
