"""What a user's own estimator, law, module or checker does wrong is said as theirs: where, what, file and line."""

import json
import pickle
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from flying import PROCESSES
from own_code import ESTIMATOR, LAW, broken, line_of, write

import agents
from affinet.cli.commands import main
from affinet.planning import making
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.testing.swarm import Broken, SwarmRuns
from affinet.verdicts.checking import Checker
from affinet.verdicts.temporal import always, eventually
from netem.processes.user_code import UserCodeError
from world.books.history import ARRAYS, load

SHORT = ("time.dt=0.05", "time.duration=1")
SIMPLE = ("agents.law=rest", *SHORT)  # no stress to solve
ARRAY = "an array of numbers or truths that begins with the batch axes"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(key, name, *overrides):
    return making.make(loading.load("corridor", (*SIMPLE, f'agents.{key}="{name}:Own"', *overrides)))


def refused(key, name, *overrides):
    with pytest.raises(UserCodeError) as caught:
        made(key, name, *overrides)
    return str(caught.value)


# ---- errors, before anything starts

SENSED = "np.where(seen[..., None], measured, state.measured)"
RAISING = [
    # Before: "--set: agents: matmul: ...", exit status 2, and no word of where.
    pytest.param("sense", SENSED, f"{SENSED} @ np.eye(3)", "ValueError: matmul: Input operand 1 has a", id="matmul"),
    # Before: a traceback through the planner.
    pytest.param("fuse", "late = np", "late = 1 / 0 or np", "ZeroDivisionError: division by zero", id="division"),
    pytest.param("fuse", "late = np", "late = heard['theirs'] or np", "KeyError: 'theirs'", id="channel"),
    pytest.param("init", "shape = (*batch", "shape = (*batches", "NameError: name 'batches' is not", id="name"),
    pytest.param(
        "channels",
        'return {"mine"',
        'return brief.mine or {"mine"',
        "AttributeError: 'Brief' object has no attribute 'mi",
        id="brief",
    ),
    pytest.param(
        "fuse", "late = np", "late = np.linalg.inv(np.zeros((2, 2))) or np", "LinAlgError: Singular", id="inv"
    ),
    # Before: the command ended there with status 0, as if it had passed.
    pytest.param("fuse", "late = np", "late = sys.exit() or np", "it called sys.exit()", id="exit"),
    # Before: over processes only, where an agent is alone and knows no manoeuvre; planning and in process it flew.
    pytest.param("fuse", "late = np", "late = brief.nominal[:, 0] if 1 else np", "IndexError: too many", id="alone"),
    pytest.param("fuse", "late = np", "late = brief.mission.velocity or np", "AttributeError: 'NoneType'", id="told"),
]


def raised(what, says, name):
    """A row for what an estimator raises in fuse."""
    return pytest.param("fuse", "late = np", f"late = (_ for _ in ()).throw({what}) or np", says, id=name)


MUTE = "type('Mute', (ValueError,), {'__str__': lambda self: SAYS})()"
RAISING += [
    # Before: tracebacks, exit status 1 or 130, and no summary.
    raised("__import__('asyncio').CancelledError('later')", "CancelledError: later (", "cancelled"),
    raised("GeneratorExit", "GeneratorExit (", "generator-exit"),
    raised("type('Odd', (BaseException,), {})('odd')", "Odd: odd (", "base-exception"),
    # Before: a traceback out of the words for the error.
    raised(MUTE.replace("SAYS", "1 / 0"), "Mute: (its text cannot be had: ZeroDivisionError) (", "mute"),
    raised(MUTE.replace("SAYS", "7"), "Mute: (its text cannot be had: TypeError) (", "no-text"),
    # Before: a traceback of UnicodeEncodeError where the log was written.
    raised(r"ValueError('bad \udcff name')", r"ValueError: bad \udcff name (", "surrogate"),
    # Before: raw, so that a terminal obeyed it.
    raised(r"ValueError('\x1b[31mred')", r"ValueError: \x1b[31mred (", "escape"),
]


@pytest.mark.parametrize(("method", "old", "new", "says"), RAISING)
def test_what_is_raised_names_class_method_file_and_line(method, old, new, says, folder):
    text = broken(ESTIMATOR, (old, new))
    name = write(folder, text)
    said = refused("estimator", name)
    assert said.startswith(f"{name}:Own.{method}: {says}")
    assert said.endswith(f"({folder / name}.py:{line_of(text, new)})")
    assert "\n" not in said


def test_a_traceback_that_cannot_be_kept_hides_nothing(folder, monkeypatch, capsys):
    def no_folder(*_, **__):
        raise FileNotFoundError(2, "No usable temporary directory")

    monkeypatch.setattr(tempfile, "NamedTemporaryFile", no_folder)  # as with ulimit -f 0
    name = write(folder, broken(ESTIMATOR, (SENSED, f"{SENSED} @ np.eye(3)")))
    assert main(["check", "corridor", "--set", f"agents.estimator={name}:Own"]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{name}:Own.sense: ValueError: matmul")
    assert "; traceback: not kept, No such file or directory" in line


def test_the_line_is_that_of_the_users_code_even_where_ours_stumbles(folder):
    text = broken(ESTIMATOR, ("brief.sensor.spread(state.measured)", "brief.sensor.spread(None)"))
    name = write(folder, text)
    assert refused("estimator", name).endswith(f"({folder / name}.py:{line_of(text, 'spread(None)')})")


def test_the_line_is_that_of_a_module_beside_that_it_calls(folder):
    other = write(folder, "def halve(number):\n    return number / 0\n")
    text = broken(
        ESTIMATOR, ("late = np", f"late = {other}.halve(1) or np"), ("import sys", f"import sys\nimport {other}")
    )
    name = write(folder, text)
    assert refused("estimator", name).endswith(f"({folder / other}.py:2)")


# ---- what methods return

ESTIMATE = "Estimate(state.measured, state.known, brief.sensor.spread(state.measured), no_indicator(state.known))"


def estimate(*changes):
    return (ESTIMATE, broken(ESTIMATE, *changes))


def reporting(reports):
    return estimate(("(state.known))", f"(state.known), reports={reports})"))


MINE = '{"mine": {"number": Field(()), "seen": Field((), bool)}}'
TOLD = '{"mine": {"number": state.measured.sum(axis=(-1, -2)), "seen": seen.any(axis=-1)}}'
FIRST = "Last(np.zeros((*shape, brief.dimension)), np.zeros(shape, dtype=bool))"
RETURNED = [
    # channels; before: AttributeErrors of ours, or a crash over processes only
    (
        "channels",
        (MINE, "None"),
        "must return a map from channels to their fields, got None",
    ),
    ("channels", (MINE, '{"Mine": {"number": Field(())}}'), "channel 'Mine': use lower-case letters, digits and '-'"),
    ("channels", (MINE, '{3: {"number": Field(())}}'), "a channel is called by a text, not 3"),
    ("channels", (MINE, '{"input": {"velocity": Field((2,))}}'), "channel 'input' is the swarm's own"),
    ("channels", (MINE, '{"mine": ["number"]}'), "channel 'mine' must be a map from names to Field(shape), got a list"),
    (
        "channels",
        (MINE, '{"mine": {"number": (2,)}}'),
        "mine.number must be a Field(shape), or Field(shape, bool), got",
    ),
    # Before: a traceback of the plan.
    ("channels", (MINE, '{"mine": {"number": Field((True,))}}'), "mine.number must have a shape like (2, 2), a tuple"),
    (
        "channels",
        (MINE, '{"mine": {"number": Field((10**12,))}}'),
        "mine.number must have at most 8 axes and 65536 numbers, as it is sent in every tick, got (1000000000000,)",
    ),
    (
        "channels",
        (MINE, '{"mine": {"number": Field((1, 10**12))}}'),
        "mine.number must have at most 8 axes and 65536 numbers",
    ),
    ("channels", (MINE, '{"mine": {"number": Field((1,) * 70)}}'), "mine.number must have at most 8 axes and 65536"),
    # Before: flew in process, and broke over processes.
    ("channels", (MINE, '{"mine": {5: Field(())}}'), "a field of channel 'mine' is called by a name like 'place', not"),
    ("channels", (MINE, '{"mine": {"nu\\nmber": Field(())}}'), r"called by a name like 'place', not 'nu\nmber' ("),
    (
        "fuse",
        reporting("{'mine': state.measured.astype(np.longdouble)}"),
        "report 'mine' must be an array of numbers (..., *) of at most 64 bits, got float128 (..., 4, 2)",
    ),
    ("channels", (MINE, '{"mine": {"number": Field(2)}}'), "mine.number must have a shape like (2, 2), a tuple of"),
    ("channels", (MINE, '{"mine": {"number": Field((), int)}}'), "mine.number holds numbers (float) or truths (bool)"),
    # init; before: flew until somebody was restarted
    ("init", (FIRST, "{'measured': np.zeros(shape)}"), "the state must be a NamedTuple of arrays that begins with"),
    (
        "init",
        (FIRST, "(np.zeros(shape), np.zeros(shape))"),
        "the state must be a NamedTuple of arrays that begins with",
    ),
    ("init", (FIRST, "Last(np.zeros((*shape, brief.dimension)), None)"), f"the state.known must be {ARRAY}, got None"),
    ("init", (FIRST, "Last(np.zeros(3), np.zeros(shape, dtype=bool))"), f"the state.measured must be {ARRAY}, got fl"),
    # sense; before: "cannot unpack", KeyErrors of ours, or other bits over processes
    ("sense", ("return state, told", "pass"), "must return the state, and what to broadcast, got None"),
    ("sense", ("return state, told", "return state"), "must return the state, and what to broadcast, got a Last"),
    (
        "sense",
        ("return state, told", "return (*state, told)"),
        "must return the state, and what to broadcast, got a tup",
    ),
    (
        "sense",
        ("return state, told", "return [state, told]"),
        "must return the state, and what to broadcast, got a list",
    ),
    ("sense", ("return state, told", "return tuple(state), told"), "the state must be a Last, as before, got a tuple"),
    ("sense", ("return state, told", "return state, None"), "what to broadcast must be a map from channels to their f"),
    ("sense", (TOLD, '{"yours": {}}'), "what to broadcast must have the channels ['mine'], got ['yours']"),
    (
        "sense",
        (TOLD, '{"mine": {"number": 1.0}}'),
        "what to broadcast on 'mine' must have the fields ['number', 'seen']",
    ),
    ("sense", ("state.measured.sum(axis=(-1, -2))", "1.0"), "mine.number must be float64 (...), got a float"),
    (
        "sense",
        ("state.measured.sum(axis=(-1, -2))", "state.measured.sum(axis=-1)"),
        "mine.number must be float64 (...), got float64 (..., 4)",
    ),
    ("sense", ("seen.any(axis=-1)", "seen.any(axis=-1) * 1"), "mine.seen must be bool (...), got int64 (...)"),
    (
        "sense",
        ("state.known | seen)", "np.append(state.known, seen, axis=-1))"),
        "known must stay what it was, bool (..., 4), got bool (..., 8)",
    ),
    (
        "sense",
        ("state.known | seen)", "1.0 * seen)"),
        "known must stay what it was, bool (..., 4), got float64 (..., 4)",
    ),
    # fuse; before: flew, with other bits over processes, or broke anywhere later
    ("fuse", ("return state, estimate", "return estimate"), "must return the state, and an Estimate, got an Estimate"),
    ("fuse", ("return state, estimate", "return state, None"), "must return an Estimate, got None"),
    ("fuse", estimate(("(state.measured, ", "(state.measured[..., 0], ")), "relative must be float64 (..., n, D) = "),
    (
        "fuse",
        estimate(("(state.measured, ", "(state.measured.astype(np.float32), ")),
        "relative must be float64 (..., n, D) = (..., 4, 2), got float32 (..., 4, 2)",
    ),
    (
        "fuse",
        estimate(("(state.measured, ", "(state.measured[..., :1], ")),
        "relative must be float64 (..., n, D) = (..., 4, 2), got float64 (..., 4, 1)",
    ),
    (
        "fuse",
        estimate(("(state.measured, ", "(state.measured.tolist(), ")),
        "relative must be float64 (..., n, D) = (.",
    ),
    ("fuse", estimate(("(state.measured, ", "(state.measured + 0j, ")), "(..., 4, 2), got complex128 (..., 4, 2)"),
    (
        "fuse",
        estimate(("(state.measured, ", "(state.measured.astype(object), ")),
        "(..., 4, 2), got object (..., 4, 2)",
    ),
    (
        "fuse",
        estimate(("(state.measured, ", "(None, ")),
        "relative must be float64 (..., n, D) = (..., 4, 2), got None",
    ),
    (
        "fuse",
        estimate((" state.known, ", " state.known * 1, ")),
        "known must be bool (..., n) = (..., 4), got int64 (...",
    ),
    (
        "fuse",
        estimate(("brief.sensor.spread(", "(")),
        "covariance must be float64 (..., n, D, D) = (..., 4, 2, 2), got f",
    ),
    ("fuse", estimate(("no_indicator(state.known)", "np.nan")), "psi must be float64 (...), got a float"),
    (
        "fuse",
        estimate(("no_indicator(state.known)", "state.known * 1.0")),
        "psi must be float64 (...), got float64 (..., 4",
    ),
    (
        "fuse",
        estimate(("(state.known))", "(state.known), state.known)")),
        "relative_velocity must be float64 (..., n, D)",
    ),
    ("fuse", estimate(("(state.known))", "(state.known), None, True)")), "feasible must be bool (...), got a bool"),
    ("fuse", reporting("[1]"), "reports must be a map from names to arrays, got a list"),
    ("fuse", reporting("{'my report': state.measured}"), "a report is called by a name like 'place', not 'my report'"),
    (
        "fuse",
        reporting("{'mine': 3.0}"),
        "report 'mine' must be an array of numbers (..., *) of at most 64 bits, got a float",
    ),
    (
        "fuse",
        reporting("{'mine': np.zeros((3, 3))}"),
        "report 'mine' must be an array of numbers (..., *) of at most 64 bits, got float64",
    ),
    (
        "fuse",
        reporting("{'mine': state.measured.astype(str)}"),
        "report 'mine' must be an array of numbers (..., *) of at most 64 bits, got",
    ),
]


@pytest.mark.parametrize(("method", "change", "says"), RETURNED, ids=[says for _, _, says in RETURNED])
def test_what_a_method_returns_is_what_was_asked_of_it(method, change, says, folder):
    text = broken(ESTIMATOR, change)
    name = write(folder, text)
    said = refused("estimator", name)
    assert said.startswith(f"{name}:Own.{method}: ")
    assert says in said
    assert said.endswith(f"({folder / name}.py:{line_of(text, f'def {method}(')})")


COMMANDS = [
    (
        "return Total(state.force + force), -force",
        "return -force",
        "must return the state, and the input, got a ndarray",
    ),
    ("), -force", "), None", "the input must be float64 (..., D) = (..., 2), got None"),
    ("), -force", "), -estimate.relative", "the input must be float64 (..., D) = (..., 2), got float64 (..., 4, 2)"),
    # Before: flew, with other bits over processes than in process.
    (
        "), -force",
        "), -force.astype(np.float32)",
        "the input must be float64 (..., D) = (..., 2), got float32 (..., 2)",
    ),
    ("Total(state.force + force)", "None", "the state must be a Total, as before, got None"),
    ("= np.where", "= 1 / 0 * np.where", "ZeroDivisionError: division by zero"),
]


@pytest.mark.parametrize(("old", "new", "says"), COMMANDS, ids=[says for _, _, says in COMMANDS])
def test_what_a_law_commands_is_an_input(old, new, says, folder):
    name = write(folder, broken(LAW, (old, new)))
    assert refused("law", name).startswith(f"{name}:Own.command: {says}")


def test_an_estimator_and_a_law_that_do_all_this_right_fly(folder):
    estimator, law = write(folder, ESTIMATOR), write(folder, LAW)
    assert rehearse(made("estimator", estimator, f'agents.law="{law}:Own"')).outcome.verdict == "pass"


# ---- what is no estimator


def shortened(text, method):
    return re.sub(rf"    def {method}\(.*?(?=\n    def |\Z)", "    pass\n", text, flags=re.DOTALL)


@pytest.mark.parametrize("method", ["channels", "init", "sense", "fuse"])
def test_a_missing_method_is_named(method, folder):
    text = shortened(ESTIMATOR, method)
    name = write(folder, text)
    said = refused("estimator", name)
    assert said.startswith(f"{name}:Own: has no method {method}: Estimator in docs/estimators.md says what each does (")
    assert f"{name}.py:{line_of(text, '@dataclass')})" in said


STUB = (
    ("class Own", "class Own(Estimator)"),
    ("import sys", "import sys\nfrom affinet import Estimator"),
)
ABSTRACT = (
    ("import sys", "import abc"),
    ("class Own", "class Own(abc.ABC)"),
    ("    def fuse", "    @abc.abstractmethod\n    def fuse"),
)
LACKING = [
    pytest.param("law", shortened(LAW, "command"), "has no method command: Law in docs/laws.md", id="law"),
    pytest.param("law", ESTIMATOR, "has no method command: Law in docs/laws.md", id="estimator-as-law"),
    pytest.param("estimator", LAW, "has no method channels, sense, fuse: Estimator in docs/est", id="law-as-estimator"),
    # Before: the method of the protocol was called, which returns nothing.
    pytest.param("estimator", broken(shortened(ESTIMATOR, "fuse"), *STUB), "has no method fuse", id="protocol"),
    # Before: a traceback.
    pytest.param("estimator", broken(ESTIMATOR, *ABSTRACT), "has no method fuse", id="abstract"),
    # Before: exit status 2, as if the scenario were wrong.
    pytest.param("estimator", broken(ESTIMATOR, ("@dataclass(frozen=True)\n", "")), "is not a dataclass", id="plain"),
]


ORDER = "    order: ClassVar[int] = 1\n"
LACKING += [
    pytest.param("law", broken(LAW, (ORDER, "")), "has no 'order': 1 if it steers velocities, 2 if acc", id="order"),
    pytest.param("law", broken(LAW, (ORDER, ORDER.replace("1", "7"))), "'order' is 7: 1 if it steers", id="order-7"),
    pytest.param("law", broken(LAW, ("by_stress", "stress")), "has no 'by_stress': whether it weighs", id="by-stress"),
]


@pytest.mark.parametrize(("key", "text", "says"), LACKING)
def test_what_is_no_algorithm_says_what_it_lacks(key, text, says, folder):
    name = write(folder, text)
    assert refused(key, name).startswith(f"{name}:Own: {says}")


def test_a_method_with_other_parameters_is_named(folder):
    text = broken(ESTIMATOR, ("def fuse(self, brief, state, heard, own):", "def fuse(self, brief, state, heard):"))
    name = write(folder, text)
    said = refused("estimator", name)
    assert "fuse: TypeError: Own.fuse() takes 4 positional arguments but 5 were given" in said
    assert said.endswith(f"{name}.py:{line_of(text, 'def fuse')})")


# ---- modules

IMPORTS = [
    # Before: a traceback.
    pytest.param("class Last(", "class Last((", "SyntaxError: ", id="syntax"),
    pytest.param("class Last(", "1 / 0\nclass Last(", "ZeroDivisionError: division by zero", id="error"),
    # Before: the command ended with this status, and no word.
    pytest.param("class Last(", "sys.exit(0)\nclass Last(", "it called sys.exit()", id="exit"),
    # Before: "cannot load", as if the module itself were not there.
    pytest.param(
        "import sys", "import no_such_library", "ModuleNotFoundError: No module named 'no_such_lib", id="other"
    ),
    pytest.param("import sys", "from sys import no_such", "ImportError: cannot import name 'no_such'", id="name"),
    # Before: a traceback, or the command ended as if interrupted.
    pytest.param("class Last(", "raise GeneratorExit\nclass Last(", "GeneratorExit", id="generator-exit"),
    pytest.param("class Last(", "raise KeyboardInterrupt\nclass Last(", "KeyboardInterrupt", id="no-ctrl-c"),
    pytest.param("class Last(", "raise ValueError('\\udcff')\nclass Last(", r"ValueError: \udcff", id="surrogate"),
]


@pytest.mark.parametrize(("old", "new", "says"), IMPORTS)
def test_a_module_that_cannot_be_imported_says_why_and_where(old, new, says, folder):
    text = broken(ESTIMATOR, (old, new))
    name = write(folder, text)
    said = refused("estimator", name)
    assert said.startswith(f"importing {name}: {says}")
    assert re.search(rf"\({re.escape(str(folder / name))}\.py:{line_of(text, new.splitlines()[0])}\)$", said)


PATHS = [
    ("nosuch:Own", "cannot load nosuch:Own: No module named 'nosuch'; it is looked for beside what names it, beside"),
    ("NAME:Owm", "cannot load NAME:Owm: NAME has no 'Owm'; did you mean 'Own'?"),
    ("NAME:Own.Inner", "cannot load NAME:Own.Inner: NAME has no 'Inner'"),
    ("NAME:no_indicator", "cannot load NAME:no_indicator: no_indicator is no class, but a function"),
    # Before: tracebacks.
    ("NAME:", "cannot load NAME:: write it as module:Class"),
    (":Own", "cannot load :Own: write it as module:Class"),
    (".NAME:Own", "cannot load .NAME:Own: write it as module:Class"),
]


@pytest.mark.parametrize(("path", "says"), PATHS)
def test_a_path_that_leads_nowhere_is_a_problem_of_the_scenario(path, says, folder):
    name = write(folder, ESTIMATOR)
    with pytest.raises(ScenarioError) as caught:
        making.make(loading.load("corridor", [*SIMPLE, f'agents.estimator="{path.replace("NAME", name)}"']))
    assert f"agents.estimator: {says.replace('NAME', name)}" in str(caught.value)


def test_what_a_module_prints_is_none_of_the_answer(folder, capsys):
    # Before: "--json | jq" choked on it.
    text = broken(
        ESTIMATOR, ("import sys", "import sys\nprint('imported')"), ("late = np", "print('fused'); late = np")
    )
    name = write(folder, text)
    assert main(["check", "corridor", "--estimator", f"{name}:Own", "--json"]) == 0
    checked = capsys.readouterr()
    assert json.loads(checked.out)["flies"] is True
    assert "imported" in checked.err
    short = [option for override in SIMPLE for option in ("--set", override)]
    assert main(["run", "corridor", "--estimator", f"{name}:Own", "--json", "--runtime", "inprocess", *short]) == 0
    flown = capsys.readouterr()
    assert json.loads(flown.out)["verdict"] == "pass"
    assert "fused" in flown.err


LOOKED_UP = [
    # Before: tracebacks, exit status 1.
    pytest.param(
        ("class Own:", "class Another:"),
        "\ndef __getattr__(name):\n    raise LookupError(name)\n",
        "looking up 'Own' in NAME: LookupError: ",
        id="module",
    ),
    pytest.param(
        ("def channels(", "def __getattribute__(self, name):\n        return 1 / 0\n\n    def channels("),
        "",
        "NAME:Own.__getattribute__: ZeroDivisionError: division by zero",
        id="instance",
    ),
    pytest.param(
        ("    def fuse(", "    @lambda _: type('Late', (), {'__get__': lambda *_: 1 / 0})()\n    def fuse("),
        "",
        "NAME:Own.fuse: ",
        id="method",
    ),
]


@pytest.mark.parametrize(("change", "more", "says"), LOOKED_UP)
def test_what_looking_up_raises_is_theirs(change, more, says, folder):
    text = broken(ESTIMATOR, change) + more
    name = write(folder, text)
    said = refused("estimator", name)
    assert said.startswith(says.replace("NAME", name))
    assert f"{name}.py:" in said


@pytest.mark.parametrize("package", ["affinet", "agents", "world", "netem", "analysis"])
def test_a_module_called_like_a_package_of_ours_is_to_be_renamed(package, folder, capsys):
    # Before: it took the place of ours, and what was imported next broke.
    (folder / f"{package}.py").write_text(ESTIMATOR)
    assert main(["check", "corridor", "--estimator", f"{package}:Own"]) == 2
    file = folder / f"{package}.py"
    assert f"{file} is called like a package of affinet's own: rename it" in capsys.readouterr().err


def test_a_scenario_beside_affinets_own_packages_may_name_what_is_in_them():
    beside = Path(agents.__file__).parents[1]
    given = ("agents.estimator=agents.estimators.rkf:RelativeKalmanFilter", *SIMPLE)
    assert making.make(loading.load("corridor", given, beside)).estimator.folder == str(beside)
    assert rehearse(making.make(loading.load("corridor", SIMPLE))).outcome.verdict == "pass"


SLEEPER = "import sys\nimport threading\n\nthreading.Thread(target=threading.Event().wait).start()"


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(["check"], id="check"),
        pytest.param(["run", "--runtime", "processes"], id="processes", marks=PROCESSES),
    ],
)
def test_a_thread_that_a_module_starts_keeps_no_process(arguments, folder):
    # Before: the command never returned, and over processes failed for agents that had not left.
    name = write(folder, broken(ESTIMATOR, ("import sys", SLEEPER)))
    verb, *options = arguments
    settings = [option for override in SIMPLE for option in ("--set", override)]
    program = [sys.executable, "-m", "affinet", verb, "corridor", *options]
    done = subprocess.run(
        [*program, "--estimator", f"{name}:Own", *settings], check=False, capture_output=True, timeout=300
    )
    assert done.returncode == 0, done.stderr


# ---- in flight

LATE = ("return state, estimate", "return state, 1 / 0 if late else estimate")
FLYING = [
    ("fuse", LATE, "ZeroDivisionError: division by zero"),
    (
        "fuse",
        ("return state, estimate", "return state, None if late else estimate"),
        "must return an Estimate, got None",
    ),
    (
        "fuse",
        ("return state, estimate", "return state, estimate._replace(reports={'x': state.known} if late else {})"),
        "reports must have the names [], got ['x']",
    ),
    (
        "fuse",
        (
            "return state, estimate",
            "return state, estimate._replace(reports={'x': state.known[..., : 1 if late else 4]})",
        ),
        "report 'x' must stay what it was, (..., 4), got bool (..., 1)",
    ),
    (
        "fuse",
        ("return state, estimate", "return state._replace(known=state.known[..., : 2 if late else 4]), estimate"),
        "known must stay what it was, bool (..., 4), got bool (..., 2)",
    ),
]


@pytest.mark.parametrize(("method", "change", "says"), FLYING, ids=[says for _, _, says in FLYING])
def test_what_goes_wrong_in_flight_says_in_which_tick(method, change, says, folder):
    name = write(folder, broken(ESTIMATOR, change))
    with pytest.raises(UserCodeError) as caught:
        rehearse(made("estimator", name))
    assert str(caught.value).startswith(f"{name}:Own.{method} in tick 7: {says}")


def test_a_run_that_it_ends_leaves_what_was_flown_and_the_traceback(folder, out):
    name = write(folder, broken(ESTIMATOR, LATE))
    done = fly(made("estimator", name), "inprocess", out, lambda *_: None)
    assert (done.verdict, done.user_code, done.ticks) == ("fail", True, 7)
    (reason,) = done.reasons
    assert reason.startswith(f"{name}:Own.fuse in tick 7: ZeroDivisionError: division by zero ({folder / name}.py:")
    assert json.loads((out / "summary.json").read_text())["reasons"] == [reason]
    assert load(out / ARRAYS)["position"].shape == (8, 7, 2)
    traceback = (out / "logs" / "inprocess.log").read_text()
    assert "return state, 1 / 0 if late else estimate" in traceback
    assert traceback.rstrip().endswith(reason)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        # Before: tracebacks, and no summary.
        pytest.param("raise GeneratorExit", "GeneratorExit (", id="generator-exit"),
        pytest.param("raise KeyboardInterrupt", "KeyboardInterrupt (", id="no-ctrl-c"),
        pytest.param(r"raise ValueError('\udcff')", r"ValueError: \udcff (", id="surrogate"),
    ],
)
def test_whatever_ends_a_run_leaves_a_summary(change, says, folder, out):
    text = broken(
        ESTIMATOR, ("return state, estimate", f"if late:\n            {change}\n        return state, estimate")
    )
    name = write(folder, text)
    done = fly(made("estimator", name), "inprocess", out, lambda *_: None)
    assert (done.verdict, done.user_code, done.ticks) == ("fail", True, 7)
    assert done.reasons[0].startswith(f"{name}:Own.fuse in tick 7: {says}")
    assert json.loads((out / "summary.json").read_text())["reasons"] == list(done.reasons)
    assert says.partition(" (")[0] in (out / "logs" / "inprocess.log").read_text()


@pytest.mark.parametrize("where", ["import", "method"])
def test_ctrl_c_in_a_users_code_is_nobodys_mistake(where, folder):
    interrupt = "signal.raise_signal(signal.SIGINT)"
    change = {
        "import": ("import sys", f"import signal\n{interrupt}"),
        "method": ("late = np", f"import signal; late = {interrupt} or np"),
    }[where]
    name = write(folder, broken(ESTIMATOR, change))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            made("estimator", name)
    finally:
        signal.signal(signal.SIGINT, before)


def test_one_that_ends_in_the_first_tick_leaves_a_summary(folder, out):
    text = broken(ESTIMATOR, ("return state, told", "return state, told[1 if seen.any() else 'mine'] and told"))
    done = fly(made("estimator", write(folder, text)), "inprocess", out, lambda *_: None)
    assert (done.verdict, done.user_code, done.ticks, done.digest) == ("fail", True, 0, None)
    assert "Own.sense in tick 0: KeyError: 1 (" in done.reasons[0]


@PROCESSES
def test_over_processes_the_words_are_those_of_in_process_and_name_the_agent(folder, out, capsys):
    name = write(folder, broken(ESTIMATOR, LATE))
    arguments = [
        "run",
        "corridor",
        "--estimator",
        f"{name}:Own",
        "--json",
        "--duration",
        "1",
        "--set",
        "time.dt=0.05",
        "--set",
        "agents.law=rest",
    ]
    assert main([*arguments, "--runtime", "inprocess", "--out", str(folder / "inprocess")]) == 3
    (here,) = json.loads(capsys.readouterr().out)["reasons"]
    assert main([*arguments, "--out", str(out)]) == 3
    flown = capsys.readouterr()
    (there,) = json.loads(flown.out)["reasons"]
    agent, words = re.fullmatch(r"agent (\d): (.*)", there).groups()
    assert words == here
    assert f"traceback: in {out / 'logs'}" in flown.err
    assert "return state, 1 / 0 if late else estimate" in (out / "logs" / f"agent-{agent}.log").read_text()


# ---- from the command line, in studies, hunts and tests


@pytest.mark.parametrize("command", [["check"], ["run"], ["hunt", "--invariant", "bounded(1)"]])
def test_before_take_off_the_status_is_3_and_the_traceback_in_a_file(command, folder, capsys):
    name = write(folder, broken(ESTIMATOR, (SENSED, f"{SENSED} @ np.eye(3)")))
    verb, *options = command
    assert main([verb, "corridor", "--estimator", f"{name}:Own", *options]) == 3
    line = capsys.readouterr().err.splitlines()[-1]
    said, _, log = line.partition("; traceback: ")
    assert said.startswith(f"{name}:Own.sense: ValueError: matmul")
    with open(log) as kept:
        assert "@ np.eye(3)" in kept.read()


def test_an_error_survives_the_way_from_a_worker(folder):
    name = write(folder, broken(ESTIMATOR, LATE))
    with pytest.raises(UserCodeError) as caught:
        rehearse(made("estimator", name))
    caught.value.during = "case {}"
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    assert str(caught.value).startswith(f"case {{}}: {name}:Own.fuse in tick 7: ")


MINE = """
title = "mine"
source = "me"
figure = "curves"
scenario = "corridor"
full = { runs = 1 }
quick = { runs = 1 }
[[axes]]
name = "column"
values = { here = [] }
[[axes]]
name = "row"
values = { here = [] }
"""


def test_a_study_names_the_case(folder, capsys):
    name = write(folder, broken(ESTIMATOR, (SENSED, f"{SENSED} @ np.eye(3)")))
    (folder / "mine.toml").write_text(f"""{MINE}[[axes]]
name = "estimator"
values = {{ none = ["agents.estimator=none"], own = ["agents.estimator={name}:Own"] }}
""")
    assert main(["study", "mine.toml"]) == 3
    assert (
        capsys.readouterr()
        .err.splitlines()[-1]
        .startswith(f"case column=here, row=here, estimator=own: {name}:Own.sense: ValueE")
    )


SET = 'set = ["agents.estimator={}:Own", "agents.law=rest", "time.dt=0.05", "time.duration=0.5"]'
SHARES = """
[[axes]]
name = "share"
values = { all = ["network.availability=1.0"], half = ["network.availability=0.5"] }
"""


@pytest.mark.parametrize(
    ("fails", "named"),
    [
        ("0.0 < seen.sum() < 0.9 * brief.present.sum()", "case column=here, row=here, share=half"),
        ("np.size(brief.number) > 7", "case column=here, row=here, share=all, or column=here, row=here, share=half"),
    ],
    ids=["one of them", "nobody knows which"],
)
def test_of_cases_that_fly_together_the_one_is_named_whose_code_fails(fails, named, folder, capsys):
    name = write(folder, broken(ESTIMATOR, (SENSED, f"1 / 0 if {fails} else {SENSED}")))
    (folder / "mine.toml").write_text(SET.format(name) + MINE + SHARES)
    assert main(["study", "mine.toml", "--jobs", "1"]) == 3  # both are one batch
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith(f"{named}: {name}:Own.sense in tick 0: ZeroDivisionError: division by zero")


def test_a_hunt_ends_with_the_smallest_timeline_that_breaks_the_code(folder, capsys):
    nothing_seen = "(state.known.sum(axis=-1) == 0).any()"
    text = broken(
        ESTIMATOR,
        ("state.known | seen)", "seen)"),
        ("return state, estimate", f"return state, 1 / 0 if np.max(own.tick) > 2 and {nothing_seen} else estimate"),
    )
    name = write(folder, text)
    scene = f"--estimator {name}:Own --availability 1 --duration 0.5 --set time.dt=0.05 --set agents.law=rest".split()
    assert main(["hunt", "corridor", *scene, "--verbs", "cut", "--invariant", "bounded(1e9)", "--budget", "20"]) == 3
    line = capsys.readouterr().err.splitlines()[-1]
    timeline, words = re.match(r"with the timeline (\[.*?\}\]): (.*)", line).groups()
    assert [entry["verb"] for entry in json.loads(timeline)] == ["cut"]
    assert re.match(rf"{name}:Own\.fuse in tick \d+: ZeroDivisionError: division by zero", words)


def test_a_test_fails_by_it_even_if_it_expects_a_failure(folder, tmp_path):
    name = write(folder, broken(ESTIMATOR, LATE))
    swarm = SwarmRuns("inprocess", None, lambda: tmp_path, tmp_path)(
        "corridor", *SIMPLE, f"agents.estimator={name}:Own"
    )
    with pytest.raises(Broken, match=rf"^{name}:Own\.fuse in tick 7: ZeroDivisionError"):
        swarm.fly("fail")


# ---- checkers


def raising(run):
    return run.arrays["no such"]


CHECKERS = [
    (Checker("mine", raising), "mine: KeyError: 'no such' ("),
    (Checker("mine", lambda _: None), "mine: must return a CheckResult, got None ("),  # type: ignore[return-value]
    (Checker("mine", raising) & Checker("other", raising), "mine: KeyError: 'no such' ("),
    (always(raising), "raising: KeyError: 'no such' ("),
    # Before: AttributeErrors of ours, or a pass for a signal of another length.
    (always(lambda run: run.error), "<lambda>: a signal must be bool (T,) = (20,), got float64 (20,) ("),  # type: ignore[return-value]
    (always(lambda run: (run.error < 1)[:5]), "<lambda>: a signal must be bool (T,) = (20,), got bool (5,) ("),
    (eventually(lambda _: True, name="once"), "<lambda>: a signal must be bool (T,) = (20,), got a bool ("),  # type: ignore[return-value]
]


@pytest.mark.parametrize(("checker", "says"), CHECKERS, ids=[says for _, says in CHECKERS])
def test_a_checker_that_fails_is_named_with_file_and_line(checker, says):
    evidence = rehearse(making.make(loading.load("corridor", SHORT)))
    with pytest.raises(UserCodeError) as caught:
        checker(evidence)
    assert str(caught.value).startswith(says)
    assert re.search(r"test_user_code\.py:\d+\)$", str(caught.value))


# ---- what is given is not theirs to write to

FUSED, COMMANDED = "late = np.max(own.tick) >= 7", "force = np.where(estimate.known"
WRITES = [
    ("estimator", ESTIMATOR, "sense", SENSED, "measured[...] += 1.0"),
    ("estimator", ESTIMATOR, "sense", SENSED, "seen[...] = True"),
    ("estimator", ESTIMATOR, "sense", SENSED, "state.measured[...] += 1.0"),
    ("estimator", ESTIMATOR, "sense", SENSED, "brief.nominal[...] += 1.0"),
    ("estimator", ESTIMATOR, "sense", SENSED, "brief.sensor.covariance[...] *= 2.0"),
    ("estimator", ESTIMATOR, "fuse", FUSED, "heard['input'].fields['velocity'][...] += 1.0"),
    ("estimator", ESTIMATOR, "fuse", FUSED, "heard['mine'].fresh[...] = True"),
    ("estimator", ESTIMATOR, "fuse", FUSED, "own.velocity[...] += 1.0"),
    ("estimator", ESTIMATOR, "fuse", FUSED, "own.input[...] += 1.0"),
    ("law", LAW, "command", COMMANDED, "estimate.relative[...] += 1.0"),
    ("law", LAW, "command", COMMANDED, "inputs.fields['velocity'][...] += 1.0"),
    ("law", LAW, "command", COMMANDED, "state.force[...] += 1.0"),
]


@pytest.mark.parametrize(("key", "text", "method", "before", "write_"), WRITES, ids=[row[-1] for row in WRITES])
def test_what_is_given_can_be_read_and_not_written(key, text, method, before, write_, folder):
    """Before: in process it was everybody's, and a run passed with other bits than over processes."""
    place = next(line for line in text.splitlines() if before in line)
    indent = place[: len(place) - len(place.lstrip())]
    name = write(folder, broken(text, (place, f"{indent}{write_}\n{place}")))
    said = refused(key, name)
    assert said.startswith(f"{name}:Own.{method}: ValueError: ")
    assert "read-only" in said


def test_the_swarm_that_checks_look_at_cannot_be_written(folder):
    checks = "\n    def checks(self, swarm):\n        swarm.nominal[...] = 0.0\n        return []\n"
    assert "read-only" in refused("estimator", write(folder, ESTIMATOR + checks))


# ---- arrays that no message carries


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (estimate(("(state.measured, ", "(np.ma.masked_array(state.measured), ")), "got a MaskedArray"),
        (reporting("{'mine': np.ma.masked_array(state.measured)}"), "got a MaskedArray"),
        (
            reporting("{'mine': np.zeros((*state.known.shape[:-1], 2, 0, 3))}"),
            "report 'mine' must have a number at least",
        ),
        (
            reporting("{'mine': np.zeros((*state.known.shape[:-1], 65537))}"),
            "report 'mine' must have at most 8 axes and",
        ),
    ],
)
def test_what_no_message_carries_is_refused_before_anything_flies(change, says, folder):
    assert says in refused("estimator", write(folder, broken(ESTIMATOR, change)))


@pytest.mark.parametrize(
    ("channels", "says"),
    [
        (
            "{'mine': {'number': Field((2, 0, 3))}}",
            "mine.number must have a shape like (2, 2), a tuple of whole numbers from 1",
        ),
        ("{f'mine{n}': {'number': Field(())} for n in range(101)}", "must return at most 100 channels"),
    ],
)
def test_channels_that_no_message_or_journal_holds_are_refused(channels, says, folder):
    declared = 'return {"mine": {"number": Field(()), "seen": Field((), bool)}}'
    assert says in refused("estimator", write(folder, broken(ESTIMATOR, (declared, f"return {channels}"))))


ODD_WORD = "type('Odd', (), {'__eq__': lambda *_: 1 / 0, '__repr__': lambda *_: 1 / 0})()"


@pytest.mark.parametrize("order", ["1.0", "True", "np.int64(1)", "np.array([1, 2])", ODD_WORD])
def test_an_order_that_is_no_whole_number_is_the_laws_own_fault(order, folder):
    """Before: a traceback, or it flew."""
    name = write(folder, broken(LAW, ("order: ClassVar[int] = 1", f"order: ClassVar[int] = {order}")))
    assert refused("law", name).startswith(f"{name}:Own")


@pytest.mark.parametrize("by_stress", ["0", "np.array([True, False])", ODD_WORD])
def test_by_stress_is_a_truth(by_stress, folder):
    name = write(folder, broken(LAW, ("by_stress: ClassVar[bool] = False", f"by_stress: ClassVar[bool] = {by_stress}")))
    assert refused("law", name).startswith(f"{name}:Own")


@pytest.mark.parametrize("size", [0, 2, 6])
def test_a_step_is_that_of_the_followers(size, folder):
    step = f"\n    def step_matrix(self, stress, degree, dt):\n        return 0.5 * np.eye({size})\n"
    text = broken(LAW, ("by_stress: ClassVar[bool] = False", "by_stress: ClassVar[bool] = True")) + step
    assert "the step is that of 4 followers" in refused("law", write(folder, text))
