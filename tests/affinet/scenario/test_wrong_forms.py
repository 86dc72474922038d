"""A value of the wrong form, or a word that there is not: one line, with the key, what was given and the right form."""

import re
from typing import Literal, get_origin

import pytest
from pydantic import BaseModel, TypeAdapter

from affinet.cli.commands import main
from affinet.planning import making
from affinet.scenario import forms, loading
from affinet.scenario.sections import Scenario
from affinet.scenario.words import one_line, shown
from affinet.scenario.wrong import ScenarioError
from affinet.studies.study import Study
from affinet.verdicts import invariants

RAW = re.compile(
    r"Input |valid (dictionary|list|string|number|integer|boolean)|instance of|ValidationError|Value error"
)


def refused(*overrides):
    """What is said of the corridor with these overrides."""
    flown = "target" if "parameters.target" in overrides[0] else "corridor"
    with pytest.raises(ScenarioError) as error:
        making.make(loading.load(flown, overrides))
    (line,) = str(error.value).splitlines()
    assert not RAW.search(line)
    return line.removeprefix("override: ")


# ---- types: each of these was told in pydantic's own words, and a list of wrong elements in a line for each

OWN = "formation={ nodes = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], leaders = [1, 2, 3], edges = %s }"
WRONG_FORMS = [
    pytest.param(
        OWN % "[[1, 2], [2, 3], [1, 3]]",
        'formation.edges.1: should be text in quotes, like "1-2", got [1, 2] (2 more like it in formation.edges)',
        id="edges as lists",
    ),
    pytest.param(
        OWN % '"1-2"', 'formation.edges: should be a list, like ["1-2", "2-3"], got "1-2"', id="text for a list"
    ),
    pytest.param(
        OWN % '["1-2", 3]', 'formation.edges.2: should be text in quotes, like "1-2", got 3', id="number for text"
    ),
    pytest.param('time="0.01"', 'time: should be a table, like { dt = 0.01, duration = 60.0 }, got "0.01"', id="no table"),
    pytest.param("time=[0.01, 60]", "time: should be a table, like { dt = 0.01, duration = 60.0 }, got [0.01, 60]", id="list"),
    pytest.param('time.dt="0.01"', 'time.dt: should be a number, like 0.01, without quotes, got "0.01"', id="quotes"),
    pytest.param("time.dt=[0.01]", "time.dt: should be a number, like 0.01, got [0.01]", id="list for a number"),
    pytest.param("time.dt={ s = 1 }", "time.dt: should be a number, like 0.01, got { s = 1 }", id="table for a number"),
    pytest.param("time.dt=true", "time.dt: should be a number, like 0.01, got true", id="truth for a number"),
    pytest.param("time.dt=1979-05-27", "time.dt: should be a number, like 0.01, got 1979-05-27", id="date"),
    pytest.param("seed=1.5", "seed: should be a whole number, like 1, got 1.5", id="fraction"),
    pytest.param(f"seed={'9' * 4000}", "seed: should be less than 18446744073709551616, got a number of 13288 bits", id="long"),
    pytest.param(
        f'seed="{"x" * 500}"', f'seed: should be a whole number, like 1, got "{"x" * 56}...', id="cut to a length"
    ),
    pytest.param('network.coupled="true"', 'should be true or false, like true, without quotes, got "true"', id="truth"),
    pytest.param("sensing.sigma=[]", "sensing.sigma: should be a number, like 1.0, got []", id="empty list"),
    pytest.param("timeline={ verb = 'cut' }", 'timeline: should be a list, like [{ verb = "cut", at = 1.0,', id="table"),
    pytest.param("timeline=['cut']", 'timeline.1: should be a table, like { verb = "cut", at = 1.0,', id="text for an entry"),
    pytest.param("timeline=[{ at = 1 }]", "timeline.1: needs a verb among cut, partition, ", id="no verb"),
    pytest.param("timeline=[{ verb = ['cut'] }]", '"lie, got ["cut"]'.strip('"'), id="verb in a list"),
    pytest.param(
        "timeline=[{ verb = 'kill', at = 1, agents = [[4]] }]",
        "timeline.1.agents.1: [4] selects no agents; write a number, 'leaders'",
        id="agents in lists",
    ),
    pytest.param(
        "timeline=[{ verb = 'kill', at = 1, agents = [true] }]", "timeline.1.agents.1: true selects no agents", id="true"
    ),
    pytest.param(
        "timeline=[{ verb = 'cut', at = 1, links = [[1, 2]] }]",
        'timeline.1.links.1: should be text in quotes, like "1-2", got [1, 2]',
        id="links as lists",
    ),
    pytest.param(
        "timeline=[{ verb = 'partition', at = 1, groups = 'halfs' }]",
        "timeline.1.groups: give at least two lists of agents, like [[1, 2], [3, 4]], or 'halves', 'leaders', 'min-cut', "
        "got \"halfs\"; did you mean 'halves'?",
        id="a way to split",
    ),
    pytest.param(
        "timeline=[{ verb = 'partition', at = 1, groups = [['1'], [2]] }]",
        'timeline.1.groups: groups hold numbers of agents, like [[1, 2], [3, 4]], got "1"',
        id="groups of texts",
    ),
    pytest.param(
        "timeline=[{ verb = 'cut', at = 1, links = [] }]",
        'timeline.1.links: should have at least 1 item, like ["1-2", "2->4"], got []',
        id="nothing in a list",
    ),
    pytest.param(
        "timeline=[{ verb = 'bias', at = 1, links = ['all'], by = [1, 2, 3, 4] }]",
        "timeline.1.by: should have at most 3 items, like [0.5, 0.0], got [1, 2, 3, 4]",
        id="too much in a list",
    ),
    pytest.param("network.profiles=[]", "network.profiles: should be a table, like { mine = { loss = [", id="profiles"),
    pytest.param("network.profiles.a=3", "network.profiles.a: should be a table, like { loss = [", id="a profile"),
    pytest.param(
        "network.profiles.a.loss={ model = 'bernoulli', p = 0.5 }",
        'network.profiles.a.loss: should be a list, like [{ model = "bernoulli", p = 1.0 }], got { model = "bernoulli"',
        id="a loss, and no list",
    ),
    pytest.param("agents.parameters.rkf=0.5", "should be a table, like { sigma_w = 0.5 }, got 0.5", id="p"),
    pytest.param("agents.parameters.ga-rkf.sigma_w='a'", 'should be a number, like 0.5, got "a"; ga-rkf has', id="parameter"),
    pytest.param("agents.parameters.target.k=3", "parameters.target.k: should be a list, like [1.0, 2.0], got 3", id="k"),
    pytest.param("agents.parameters.target.k=['a']", 'parameters.target.k.1: should be a number, like 0.5, got "a"', id="k.1"),
    pytest.param("dynamics.kernel={}", "dynamics.kernel.length: is missing; it has no default: give a number", id="missing"),
    pytest.param(
        "manoeuvre={ keyframes = [{ time = 0 }, { time = 1 }] }",
        "manoeuvre.keyframes.1.theta: is missing; it has no default: give a list, like [[1.0, 0.0], [0.0, 1.0]] "
        "(1 more like it in manoeuvre.keyframes.theta); at least 1 more mistake: manoeuvre.keyframes.1.offset (override)",
        id="missing in every element",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("override", "says"), WRONG_FORMS)
def test_a_value_of_the_wrong_form_is_one_line_that_says_the_right_one(override, says):
    assert says in refused(override)


def test_355_wrong_edges_are_one_line(tmp_path, capsys):
    file = tmp_path / "swarm.toml"
    file.write_text(f"[formation]\nnodes = [[0.0, 0.0]]\nleaders = [1]\nedges = {[[1, n] for n in range(2, 357)]}\n")
    assert main(["check", str(file)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(
        'swarm.toml:4: formation.edges.1: should be text in quotes, like "1-2", got [1, 2] (354 more'
    )
    assert line.endswith(
        "at least 4 more mistakes: manoeuvre (swarm.toml), time (swarm.toml), sensing (swarm.toml), ..."
    )


def test_what_is_missing_because_it_was_misspelt_is_one_mistake(tmp_path):
    file = tmp_path / "swarm.toml"
    file.write_text(
        '[formation]\npreset="zhao7"\n[manouvre]\n[tmie]\n[sensing]\nsigma=1.0\n[agents]\nestimator="rkf"\nlaw="rest"'
    )
    with pytest.raises(ScenarioError) as error:
        loading.load(str(file))
    assert str(error.value).startswith("swarm.toml:3: manouvre: unknown key; did you mean 'manoeuvre'? known here: ")
    assert str(error.value).endswith("; at least 1 more mistake: tmie (swarm.toml:4)")


# ---- words


@pytest.mark.parametrize(
    ("override", "says"),
    [
        pytest.param("timeline=[{ verb = 'partitoin' }]", "got \"partitoin\"; did you mean 'partition'?", id="verb"),
        pytest.param("network.profiles.a.loss=[{ model = 'gilbret' }]", "did you mean 'gilbert'?", id="loss"),
        pytest.param("network.profiles.a.delay.model='paretto'", "got \"paretto\"; did you mean 'pareto'?", id="delay"),
        pytest.param("network.profiles.a.corrupt=[{ kind = 'bitflip', p = 0.1 }]", "did you mean 'bit-flip'?", id="corruption"),
        pytest.param("network.profile='wifi-bussy'", "no profile 'wifi-bussy'; did you mean 'wifi_busy'? there", id="profile"),
        pytest.param("agents.estimator='GA_RKF'", "no 'GA_RKF'; did you mean 'ga-rkf'? there are conral, ", id="estimator"),
        pytest.param("agents.law='varying velocity'", "no 'varying velocity'; did you mean 'varying-velocity'?", id="law"),
        pytest.param("agents.parameters.ga-rfk.x=1", "no such estimator or law; did you mean 'ga-rkf'?", id="parameters"),
        pytest.param("agents.parameters.ga-rkf.epsilom=1", "unknown; did you mean 'epsilon'?; ga-rkf has", id="parameter"),
        pytest.param("formation.preset='zhao-7'", "no preset 'zhao-7'; did you mean 'zhao7'? there are", id="preset"),
        pytest.param("manoeuvre.preset='coridor'", "got \"coridor\"; did you mean 'corridor'?", id="manoeuvre"),
        pytest.param("dynamics.model='single_integrator'", "did you mean 'single-integrator'?", id="dynamics"),
        pytest.param("timeline=[{verb='cut',at=1,links=['leader']}]", "selects no links; did you mean 'leaders'?", id="links"),
        pytest.param("timeline=[{verb='kill',at=1,agents=['follower']}]", "no agents; did you mean 'followers'?", id="agents"),
        pytest.param(
            "timeline=[{verb='cut',name='first',at=1,links=['all']},{verb='heal',after='frist'}]",
            "after 'frist': name one entry, or its end as 'frist.end'; 0 are called 'frist'; did you mean 'first'?",
            id="name",
        ),
    ],
)  # fmt: skip
def test_a_word_that_there_is_not_is_echoed_with_the_nearest_that_there_is(override, says):
    assert says in refused(override)


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (["run", "corider"], "corider: no such file, and no such scenario; did you mean 'corridor'? shipped are "),
        (["check", "patrition.toml"], "did you mean 'partition'?"),
        (["study", "paper-000-fig13"], "no such study; did you mean 'paper-000-fig1"),
        (["hunt", "corridor", "--invariant", "bouned(5)"], "bouned is no checker; did you mean 'bounded'?"),
        (["hunt", "corridor", "--invariant", "bounded"], "bounded is written with what it wants: bounded(level)"),
        (["hunt", "corridor", "--invariant", "bounded(5)", "--verbs", "cutt"], "--verbs cutt: did you mean 'cut'? there are"),
    ],
)  # fmt: skip
def test_so_is_one_on_the_command_line(command, says, capsys):
    assert main(command) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_checkers_are_named_in_all_that_is_composed_of_them():
    with pytest.raises(ScenarioError, match=r"recover is no checker; did you mean 'recovers'\?; there are "):
        invariants.parse("bounded(5) & ~recover(1, within=2)")


# ---- examples


def models(model, seen):
    """A model, and all that its fields are made of."""
    if model not in seen:
        seen.append(model)
        for field in model.model_fields.values():
            for inner in parts(field.annotation):
                models(inner, seen)
    return seen


def parts(kind):
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [part for inner in getattr(kind, "__args__", ()) for part in parts(inner)]


def paths(model, before=()):
    """Every field below a model, with the path that leads to it."""
    for name, field in model.model_fields.items():
        path = (*before, name)
        yield ".".join(path), forms.annotated(field)
        for inner in parts(field.annotation):
            yield from paths(inner, (*path, "*") if "dict[" in str(field.annotation) else path)


KEYS = [*paths(Scenario), *paths(Study)]


def test_every_model_is_looked_at():
    assert len(models(Scenario, [])) > 40
    assert len(models(Study, [])) == 5
    assert len(KEYS) > 300


@pytest.mark.parametrize(("path", "kind"), KEYS, ids=[path for path, _ in KEYS])
def test_the_example_of_every_key_is_right(path, kind):
    example = forms.example(kind, path)
    assert example is not None
    TypeAdapter(kind).validate_python(example, strict=True)
    said = forms.form(kind, path)
    assert "something else" not in said
    assert said.startswith("one of") or shown(example, 120) in said
    assert said.startswith("one of") == (get_origin(forms.bare(kind)) is Literal)


def test_every_example_is_of_a_key_that_there_is():
    assert {path.removesuffix(".*") for path in forms.EXAMPLES} <= {path for path, _ in KEYS}


# ---- values that a type can be one of several of


class Several(BaseModel):
    one: list[float] | str
    two: int | bool | None = None


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"one": 3}, "one: should be a list or text in quotes, like [1.0], got 3"),
        ({"one": [1.0, "a"]}, 'one.2: should be a number, like 1.0, got "a"'),
        ({"one": "a", "two": 1.5}, "two: should be a whole number or true or false, like 1, got 1.5"),
    ],
)
def test_of_a_value_that_could_be_several_things_one_line_says_which(given, says):
    from pydantic import ValidationError

    from affinet.scenario.explain import mistakes

    with pytest.raises(ValidationError) as error:
        Several.model_validate(given, strict=True)
    (mistake,) = mistakes(error.value, Several)
    assert f"{mistake.key}: {mistake.says}" == says


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("a\nb\u2028c", '"a\\nb\\u2028c"'),
        ([1, [2, [3, [4, [5]]]]], "[1, [2, [3, [4, [...]]]]]"),
        (list(range(100)), "[0, 1, 2, 3, 4, 5, ...]"),
        ({"a": True, "b": {}}, "{ a = true, b = {} }"),
        (float("nan"), "nan"),
        (2**300, "a number of 301 bits"),
        ("é", '"é"'),
    ],
)
def test_values_are_shown_as_toml_on_one_line(value, says):
    assert shown(value) == says


def test_what_breaks_a_line_is_escaped():
    assert one_line("a\nb\x1b[1m\u2028é m²") == "a\\nb\\x1b[1m\\u2028é m²"


@pytest.mark.parametrize(
    "override",
    [
        f"agents.estimator={'[' * 5000!r}",
        f"formation.edges=['2-1{'9' * 5000}']",
        f"network.profile={'x' * 5000!r}",
        f"formation.preset={'x' * 5000!r}",
        f"agents.parameters={{rkf={{{'y' * 5000}=1.0}}}}",
        f"agents.programs={{{'7' * 5000}='sh'}}",
        f"timeline=[{{verb='kill', at=0.1, agents=[{'9' * 5000!r}]}}]",
        f"timeline=[{{verb='kill', at=0.1, agents=['random {'9' * 5000}']}}]",
        f"timeline=[{{verb='cut', at=0.1, links=['{'z' * 5000}']}}]",
    ],
    ids=lambda given: given.partition("=")[0],
)
def test_what_a_name_without_an_end_is_wrong_with_is_told_in_a_line_that_ends(override, capsys):
    """Found in a thousand malformed files: a name of thousands of letters was all one saw."""
    assert main(["check", "corridor", "--set", override]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert 20 < len(line) < 1200
    assert "..." in line


def test_a_path_of_a_usual_length_is_not_cut():
    path = "/".join(["folder" * 8] * 8)
    assert one_line(path) == path
