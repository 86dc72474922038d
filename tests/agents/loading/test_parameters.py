"""Parameters of estimators and laws are checked as strictly as everything else, also those of a user's own."""

import json
import re

import msgpack
import pytest
from own_code import ESTIMATOR, broken, line_of, write

from affinet.planning import making, registry
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from netem.core.plain import from_plain, to_plain
from netem.loading.choice import Choice
from netem.processes.user_code import UserCodeError

SIMPLE = ("agents.law=rest", "time.dt=0.05", "time.duration=0.5")
FIELDS = """\
    needed: int
    gain: float = 1.0
    whole: int = 3
    truth: bool = False
    word: str = "a"
    choice: Literal["a", "b", 3] = "a"
    pair: tuple[float, int] = (1.0, 2)
    several: tuple[float, ...] = (1.0,)
    rows: list[tuple[float, float]] = field(default_factory=lambda: [(1.0, 2.0)])
    listed: list[float] = field(default_factory=lambda: [5.0])
    maybe: float | None = None
    either: int | tuple[float, float] = 1
    table: dict[str, float] = field(default_factory=dict)
    mode: Mode = Mode.SLOW
    gains: Gains = field(default_factory=lambda: Gains(1.0))
    anything: Any = None
    array: np.ndarray | None = None
    noted: Annotated[float, "in metres"] = 1.0
    once: InitVar[float] = 2.0
    constant: ClassVar[int] = 4
    made: float = field(init=False, default=0.0)
    named: int = field(default=1, kw_only=True)

    def __post_init__(self, once):
        if self.whole == 13:
            raise ValueError("whole 13 is unlucky")
        object.__setattr__(self, "made", once)
"""
KINDS = """\
class Mode(Enum):
    SLOW = "slow"
    FAST = "fast"


@dataclass
class Gains:
    kp: float
    kd: float = 0.0


@dataclass(frozen=True)
class Own"""
WITH_FIELDS = broken(
    ESTIMATOR,
    ("import dataclass, field", "import InitVar, dataclass, field\nfrom enum import Enum"),
    ("from typing import NamedTuple", "from typing import Annotated, Any, ClassVar, Literal, NamedTuple"),
    ("class Own:\n", f"class Own:\n{FIELDS}"),
    ("@dataclass(frozen=True)\nclass Own", KINDS),
)
FUTURE = f"from __future__ import annotations\n{WITH_FIELDS}"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


@pytest.fixture(params=[WITH_FIELDS, FUTURE], ids=["annotations", "texts"])
def own(request, folder):
    """The name of an estimator with all these parameters, its annotations evaluated or not."""
    return f"{write(folder, request.param)}:Own"


def given(name, values):
    """A scenario with an estimator of this name, and the file that gives these lines as its parameters."""
    return loading.load("corridor", (*SIMPLE, f"agents.estimator={name}", f'agents.parameters."{name}"={{{values}}}'))


def built(name, values):
    """The estimator as it flies in process, and as it flies in a process of its own."""
    choice = making.make(given(name, values)).estimator
    return choice.build(), from_plain(Choice, msgpack.unpackb(msgpack.packb(to_plain(choice)))).build()


def refusal(name, values):
    with pytest.raises(ScenarioError) as caught:
        making.make(given(name, values))
    return str(caught.value)


def test_what_is_not_given_keeps_its_default(own):
    # Before: a field with default_factory arrived as the word MISSING of dataclasses, and the run passed.
    for made in built(own, "needed=1"):
        assert (made.listed, made.rows, made.table, made.pair) == ([5.0], [(1.0, 2.0)], {}, (1.0, 2))
        assert (made.needed, made.gains.kp, made.mode.value, made.made, made.named) == (1, 1.0, "slow", 2.0, 1)


FITS = [
    ("gain=2", "gain", 2.0),
    ("gain=-0.5", "gain", -0.5),
    ("choice=3", "choice", 3),
    # Before: a list, in process and over processes.
    ("pair=[1, 2]", "pair", (1.0, 2)),
    ("several=[1, 2, 3]", "several", (1.0, 2.0, 3.0)),
    ("several=[]", "several", ()),
    ("rows=[[1, 2], [3, 4]]", "rows", [(1.0, 2.0), (3.0, 4.0)]),
    ("maybe=3", "maybe", 3.0),
    ("either=3", "either", 3),
    ("either=[1, 2]", "either", (1.0, 2.0)),
    ("table={a=1}", "table", {"a": 1.0}),
    ("anything={a=[1, 'b', true]}", "anything", {"a": [1, "b", True]}),
    ("noted=3", "noted", 3.0),
    ("once=3.5", "made", 3.5),
    ("named=7", "named", 7),
]


@pytest.mark.parametrize(("values", "name", "value"), FITS, ids=[values for values, _, _ in FITS])
def test_what_is_given_becomes_what_is_annotated_in_both_runtimes(values, name, value, own):
    for made in built(own, f"needed=1, {values}"):
        assert getattr(made, name) == value
        assert repr(getattr(made, name)) == repr(value)  # 1 is not 1.0


def test_words_become_members_and_tables_become_dataclasses(own):
    for made in built(own, "needed=1, mode='fast', gains={kp=3}"):
        assert (made.mode.name, made.gains.kp, made.gains.kd) == ("FAST", 3.0, 0.0)
        assert type(made.gains).__name__ == "Gains"


REFUSED = [
    # Before: flew with the word MISSING of dataclasses in its place.
    ("gain=1.0", "needed: is missing; it has no default"),
    ("needed=1, gian=2", "gian: unknown; did you mean 'gain'?; "),
    ("needed=1, made=2.0", "made: unknown"),
    ("needed=1, constant=2", "constant: unknown"),
    ("needed=1.0", "needed: should be a whole number, like 3, got 1.0"),
    ("needed=true", "needed: should be a whole number, like 3, got true"),
    ("needed='1'", 'needed: should be a whole number, like 3, got "1"'),
    # Before: passed the check, and ended in a traceback over processes only.
    ("needed=99999999999999999999", "needed: should fit into 64 bits, got one of 67"),
    ("needed=1, gain=true", "gain: should be a number, like 0.5, got true"),
    ("needed=1, gain='much'", 'gain: should be a number, like 0.5, got "much"'),
    ("needed=1, gain=[1.0]", "gain: should be a number, like 0.5, got [1.0]"),
    # Before: flew, and diverged.
    ("needed=1, gain=inf", "gain: should be a finite number, got inf"),
    ("needed=1, gain=nan", "gain: should be a finite number, got nan"),
    ("needed=1, anything=[1, inf]", "anything.2: should be a finite number, got inf"),
    ("needed=1, truth=1", "truth: should be true or false, got 1"),
    ("needed=1, word=1", 'word: should be text in quotes, like "text", got 1'),
    ("needed=1, word=1979-05-27", 'word: should be text in quotes, like "text", got "1979-05-27"'),
    ("needed=1, anything=1979-05-27", 'anything: should be a number, truth, text, list or table, got "1979-05-27"'),
    ("needed=1, choice='c'", 'choice: should be "a", "b" or 3, got "c"'),
    ("needed=1, choice=3.0", 'choice: should be "a", "b" or 3, got 3.0'),
    ("needed=1, pair=[1.0]", "pair: should be a list of 2, got [1.0]"),
    ("needed=1, pair=[1.0, 2.5]", "pair.2: should be a whole number, like 3, got 2.5"),
    ("needed=1, several=[1.0, true]", "several.2: should be a number, like 0.5, got true"),
    ("needed=1, several=1.0", "several: should be a list, like [1.0, 2.0], got 1.0"),
    ("needed=1, rows=[[1.0, 2.0], [3.0]]", "rows.2: should be a list of 2, got [3.0]"),
    ("needed=1, maybe='no'", 'maybe: should be a number, like 0.5, got "no"'),
    (
        "needed=1, either='no'",
        'either: should be a whole number, like 3, got "no"; or should be a list, like [1.0, 2.0], got "no"',
    ),
    ("needed=1, table={a='b'}", 'table.a: should be a number, like 0.5, got "b"'),
    ("needed=1, mode='idle'", 'mode: should be "slow" or "fast", got "idle"'),
    ("needed=1, gains={}", "gains.kp: is missing; it has no default"),
    ("needed=1, gains={kp=1.0, ki=2.0}", "gains.ki: unknown"),
    (
        "needed=1, array=[1.0]",
        "array: is a ndarray, which a scenario cannot say; it says numbers, truths, texts, lists",
    ),
    ("needed=1, whole=13", ": whole 13 is unlucky"),
]


@pytest.mark.parametrize(("values", "says"), REFUSED, ids=[values for values, _ in REFUSED])
def test_what_does_not_fit_is_one_line_with_its_key(values, says, folder):
    name = f"{write(folder, FUTURE)}:Own"
    line = refusal(name, values)
    assert line.startswith(f"override: agents.parameters.{name}")
    assert says in line
    assert "\n" not in line


def test_the_parameters_there_are_are_listed(folder):
    name = f"{write(folder, FUTURE)}:Own"
    assert re.search(rf"gian: .*; {name} has needed, gain, .*once, named$", refusal(name, "needed=1, gian=2"))


def test_an_annotation_that_cannot_be_resolved_is_the_codes_own_fault(folder):
    text = broken(ESTIMATOR, ("class Own:\n", "class Own:\n    gain: 'Nowhere' = 1.0\n"))
    name = f"{write(folder, text)}:Own"
    making.make(loading.load("corridor", (*SIMPLE, f"agents.estimator={name}")))  # not given, it need not be resolved
    with pytest.raises(UserCodeError, match=rf"^{name}.__init__: NameError: name 'Nowhere' is not defined"):
        making.make(given(name, "gain=2.0"))


def test_an_inherited_parameter_is_read_by_the_annotation_of_its_own_module(folder):
    changes = (
        ("class Own:\n", "class Base:\n    gain: Number = 1.0\n\n"),
        ("class Last", "Number = float\n\n\nclass Last"),
    )
    base = write(folder, f"from __future__ import annotations\n{broken(ESTIMATOR, *changes)}")
    own = "@dataclass(frozen=True)\nclass Own(Base):\n    more: int = 1\n"
    name = write(folder, f"from dataclasses import dataclass\nfrom {base} import Base\n\n\n{own}")
    for made in built(f"{name}:Own", "gain=2, more=3"):
        assert (made.gain, type(made.gain), made.more) == (2.0, float, 3)
    assert 'gain: should be a number, like 0.5, got "x"' in refusal(f"{name}:Own", "gain='x'")


@pytest.mark.parametrize("raised", ["TypeError", "IndexError", "KeyError"])
def test_an_error_of_another_kind_while_it_is_made_is_the_codes_own_fault(raised, folder):
    post = f"class Own:\n    def __post_init__(self):\n        raise {raised}('why')\n\n"
    text = broken(ESTIMATOR, ("class Own:\n", post))
    name, line = write(folder, text), line_of(text, "raise ")
    with pytest.raises(UserCodeError, match=rf"^{name}:Own.__init__: {raised}: '?why'? \(.*{name}.py:{line}\)$"):
        making.make(loading.load("corridor", (*SIMPLE, f"agents.estimator={name}:Own")))


# ---- where they are given

WRITTEN = """\
formation = { preset = "zhao7" }
manoeuvre = { preset = "hover" }
time = { dt = 0.05, duration = 0.5 }
sensing = { sigma = 0.1 }

[agents]
estimator = "NAME:Own"
law = "rest"

"""


@pytest.mark.parametrize("header", ['[agents.parameters."NAME:Own"]', "[agents.parameters.'NAME:Own']"])
def test_a_table_in_quotes_is_read(header, folder):
    name = write(folder, FUTURE)
    file = folder / "own.toml"
    file.write_text(f"{WRITTEN}{header}\nneeded = 5\n".replace("NAME", name))
    assert making.make(loading.load(str(file))).estimator.build().needed == 5
    file.write_text(f"{WRITTEN}{header}\nneeded = 5\ngian = 5\n".replace("NAME", name))
    with pytest.raises(ScenarioError, match=rf"^own\.toml:12: agents\.parameters\.{name}:Own\.gian: unknown; did you"):
        making.make(loading.load(str(file)))


@pytest.mark.parametrize("key", ['"NAME:Own"', "'NAME:Own'", "NAME:Own"])
def test_an_override_in_quotes_is_read(key, folder):
    # Before: the quotes were taken for part of the name, and the parameters ignored.
    name = write(folder, FUTURE)
    overrides = (f"agents.parameters.{key}.needed=5".replace("NAME", name), f"agents.estimator={name}:Own")
    assert making.make(loading.load("corridor", (*SIMPLE, *overrides))).estimator.build().needed == 5


def test_a_module_in_a_package_is_named_in_quotes(folder):
    (folder / "ownpackage").mkdir()
    (folder / "ownpackage" / "inner.py").write_text(FUTURE)
    overrides = ('agents.parameters."ownpackage.inner:Own".needed=5', "agents.estimator=ownpackage.inner:Own")
    assert making.make(loading.load("corridor", (*SIMPLE, *overrides))).estimator.build().needed == 5


NOT_IN_USE = [
    # Before: all of them were ignored, and the run passed.
    ('agents.parameters."nosuch:Own".gain=1', "agents.parameters.nosuch:Own: cannot load nosuch:Own: No module named"),
    ('agents.parameters."json:Own".gain=1', "agents.parameters.json:Own: cannot load json:Own: json has no 'Own'"),
    ("agents.parameters.conral.epsilom=0.1", "agents.parameters.conral.epsilom: unknown; did you mean 'epsilon'?"),
    ("agents.parameters.conral.epsilon=inf", "agents.parameters.conral.epsilon: should be a finite number, got inf"),
    ("agents.parameters.static.alpha=inf", "agents.parameters.static.alpha: should be a finite number, got inf"),
    ("agents.parameters.pursuit.kappa=[1.0, -1.0]", "agents.parameters.pursuit: with kappa [1.0, -1.0] agents leave"),
    (
        "agents.parameters.konral.epsilon=0.1",
        "agents.parameters.konral: no such estimator or law; did you mean 'conral'? ",
    ),
]


@pytest.mark.parametrize(("override", "says"), NOT_IN_USE)
def test_parameters_of_what_is_not_in_use_are_checked_too(override, says):
    with pytest.raises(ScenarioError) as caught:
        making.make(loading.load("corridor", (*SIMPLE, "agents.estimator=none", override)))
    assert says in str(caught.value)


def test_parameters_of_what_is_not_in_use_may_be_given():
    given = ("agents.estimator=none", "agents.parameters.rkf.sigma_w=0.3", "agents.parameters.target.k=[1.0, 2.0]")
    assert making.make(loading.load("corridor", (*SIMPLE, *given))).estimator.parameters == {}


@pytest.mark.parametrize("group", [registry.ESTIMATORS, registry.LAWS])
def test_every_parameter_of_every_shipped_algorithm_refuses_a_value_of_another_kind(group):
    from netem.loading import parameters
    from netem.loading.calling import load

    for name in registry.names(group):
        for parameter in parameters.names(load(registry.choose(group, "agents", name, {}, {}).path, None)):
            with pytest.raises(ScenarioError, match=rf"^agents\.parameters\.{name}\.{parameter}: should be "):
                registry.choose(group, "agents", name, {parameter: {"a": "table"}}, {})


def test_a_run_directory_has_them_as_they_were_given(folder, out):
    from affinet.runtimes.run import fly

    name = f"{write(folder, FUTURE)}:Own"
    fly(making.make(given(name, "needed=5, pair=[3, 4]")), "inprocess", out, lambda *_: None)
    assert json.loads((out / "scenario.json").read_text())["agents"]["parameters"][name] == {
        "needed": 5,
        "pair": [3, 4],
    }
    assert making.make(loading.resolved(out)).estimator.build().pair == (3.0, 4)
    assert rehearse(making.make(loading.resolved(out))).outcome.verdict == "pass"
