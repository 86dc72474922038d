"""The pytest plugin as the tests of others see it: what passes, what fails, what a failure says and leaves behind."""

import importlib
import json
import re
import shlex
import sys
from pathlib import Path

import pytest
from flying import PROCESSES

from affinet.cli.commands import main
from affinet.scenario.wrong import ScenarioError

# A pytester forgets what its tests were the first to import; these are slow, or cannot be loaded twice.
for module in ("affinet.testing.swarm", "netem.medium.journal", "world.recording.logbook", "cvxpy", "hypothesis"):
    importlib.import_module(module)

pytest_plugins = ["pytester"]

SHORT = '"corridor", "time.dt=0.05", "time.duration=1"'
SAYS_WHERE = re.compile(r"^seed (\d+), (\w+)\nrecording: (.+)\nfly the same bits again: affinet (.+)$", re.MULTILINE)
CHECK_AGAIN = re.compile(r"^check again: pytest (.+)$", re.MULTILINE)


@pytest.fixture
def tested(pytester):
    """Runs pytest on the text of a test file, in this process."""

    def run(text, *options):
        pytester.makepyfile("from affinet import bounded, recovers\nimport pytest\n" + text)
        return pytester.runpytest_inprocess(f"--basetemp={pytester.path / 'base'}", *options)

    return run


def outcomes(result):
    """How many tests passed, failed and so on."""
    return {name: number for name, number in result.parseoutcomes().items() if name != "warnings"}


def directories(pytester):
    """Those made for runs, of whatever test."""
    return list((pytester.path / "base").glob("affinet[0-9]*"))


# ---- verdicts


def test_the_fixture_flies_and_what_it_flew_is_checked(tested):
    text = f"""
def test_flies(swarm):
    run = swarm({SHORT}).fault("cut", links=["1-2"], at=0.2, until=0.4).fly().check(bounded(5))
    assert run.ticks == 20 and run.bites[0].touched > 0
"""
    assert outcomes(tested(text)) == {"passed": 1}


def test_a_run_whose_fault_touched_nothing_fails(tested):
    text = f"""
def test_nobody_listens(swarm):
    deaf = swarm({SHORT}, "agents.estimator=rkf")
    deaf.fault("lie", agents=[4], matrix=[[2.0, 0.0], [0.0, 2.0]], at=0.5).fly()
"""
    result = tested(text)
    assert outcomes(result) == {"failed": 1}
    result.stdout.fnmatch_lines(["*Broken: the run is vacuous, not pass: 'lie 4' touched no messages*"])


def test_a_checker_that_was_not_put_to_the_test_fails(tested):
    text = f"""
def test_calm(swarm):
    swarm({SHORT}).fly().check(bounded(5), recovers(0.1, within=0.2))
"""
    result = tested(text)
    assert outcomes(result) == {"failed": 1}
    result.stdout.fnmatch_lines(["*Broken: recovers(0.1, within=0.2): vacuous: no fault that had its time*"])


def test_what_comes_out_badly_can_be_what_is_expected(tested):
    text = f"""
def test_vacuous(swarm):
    swarm({SHORT}).fault("cut", links=["1-2"], when=dict(tracking_error_above=1e9)).fly("vacuous")

@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_fails(swarm):
    gullible = swarm({SHORT}, "time.duration=2", "agents.estimator=conral")
    gullible.fault("lie", agents=["all"], at=0, matrix=[[1e9, 0.0], [0.0, 1e9]]).fly("fail")

def test_does_not_fail(swarm):
    swarm({SHORT}).fly("fail")
"""
    result = tested(text)
    assert outcomes(result) == {"passed": 2, "failed": 1}
    result.stdout.fnmatch_lines(["*Broken: the run is pass, not fail: every fault bit and nothing broke"])


@pytest.mark.parametrize(
    ("verb", "keys", "says"),
    [
        ("sever", {"at": 1, "links": ["1-2"]}, r"timeline\.1: needs a verb among cut, partition"),
        ("cut", {"at": 1, "link": ["1-2"]}, r"timeline\.1\.link: unknown key; did you mean 'links'\?"),
        ("cut", {"at": 1, "links": ["1=2"]}, r"timeline\.1\.links\.1: '1=2' selects no links"),
        ("cut", {"links": ["1-2"]}, r"timeline\.1: says not when: give at"),
        ("lose", {"at": 1, "links": ["all"], "loss": 2.0}, r"timeline\.1\.loss: should be less than or equal to 1"),
    ],
)
def test_a_wrong_verb_or_key_is_said_with_its_key(swarm, verb, keys, says):
    with pytest.raises(ScenarioError, match=says):
        swarm("corridor").fault(verb, **keys)


def test_what_only_the_formation_can_tell_is_said_when_it_flies(swarm):
    with pytest.raises(ScenarioError, match=r"timeline\.1\.links: '1-7' matches no link"):
        swarm("corridor").fault("cut", at=1, links=["1-7"]).fly()


# ---- what a failure leaves behind


def test_a_failure_says_how_to_fly_the_same_bits_again(tested, tmp_path, monkeypatch, capfd):
    text = f"""
@pytest.mark.affinet_seeds(7)
def test_breaks(swarm):
    swarm({SHORT}).fault("cut", links=["1-2"], at=0.2, until=0.4).fly().check(bounded(1e-9))
"""
    result = tested(text)
    assert outcomes(result) == {"failed": 1}
    ((seed, runtime, recording, command),) = SAYS_WHERE.findall(result.stdout.str())
    assert (seed, runtime) == ("7", "inprocess")
    assert Path(recording).stat().st_size > 0
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    capfd.readouterr()
    assert main(shlex.split(command)) == 0
    assert f"the same bits as {Path(recording).parent}" in capfd.readouterr().err.replace("\n", "")


@pytest.mark.parametrize(("options", "mark"), [((), ""), (("--affinet-runtime=processes",), "inprocess")])
def test_a_failure_says_how_to_check_it_again(tested, pytester, options, mark):
    mark = f'@pytest.mark.affinet_runtime("{mark}")' if mark else ""
    text = f"""
@pytest.mark.affinet_seeds(7, 8)
{mark}
def test_breaks(swarm):
    swarm({SHORT}).fly().check(bounded(1e-9))
"""
    first, second = CHECK_AGAIN.findall(tested(text, *options).stdout.str())
    assert first != second
    arguments = shlex.split(second)
    assert tuple(arguments[1:]) == options
    again = pytester.runpytest_inprocess(f"--basetemp={pytester.path / 'base'}", *arguments)
    assert outcomes(again) == {"failed": 1}
    again.stdout.fnmatch_lines(["*Broken: bounded(1e-09): fail: *", "seed 8, inprocess"])


def test_a_test_that_passes_leaves_nothing(tested, pytester):
    text = f"""
def test_passes(swarm):
    swarm({SHORT}).fly()

def test_of_something_else():
    assert False
"""
    result = tested(text)
    assert outcomes(result) == {"passed": 1, "failed": 1}
    assert not directories(pytester)
    result.stdout.no_fnmatch_line("*affinet replay*")


def test_of_many_runs_the_last_four_are_kept(tested, pytester):
    text = f"""
def test_breaks_late(swarm):
    for seed in range(1, 7):
        swarm({SHORT.replace("=1", "=0.5")}, f"seed={{seed}}").fly()
    assert False
"""
    result = tested(text)
    kept = SAYS_WHERE.findall(result.stdout.str())
    assert [seed for seed, *_ in kept] == ["3", "4", "5", "6"]
    assert {Path(recording).parents[1] for _, _, recording, _ in kept} == set(directories(pytester))
    assert all(Path(recording).is_file() for _, _, recording, _ in kept)


# ---- seeds, runtimes, workers


def test_a_mark_runs_a_test_once_with_each_seed(tested):
    text = f"""
seen = set()

@pytest.mark.affinet_seeds(11, 12)
def test_seeded(swarm):
    run = swarm({SHORT}).fly()
    seen.add((run.plan.scenario.seed, run.outcome.digest))

def test_both():
    assert {{seed for seed, _ in seen}} == {{11, 12}} and len({{digest for _, digest in seen}}) == 2
"""
    result = tested(text, "-v")
    assert outcomes(result) == {"passed": 3}
    result.stdout.fnmatch_lines(["*test_seeded?seed11?*", "*test_seeded?seed12?*"])


@PROCESSES
def test_the_command_line_says_where_to_fly_and_a_mark_says_otherwise(tested):
    text = """
AIR = "corridor", "time.dt=0.05", "time.duration=0.5"
digests = set()

def test_over_processes(swarm):
    run = swarm(*AIR).fly()
    assert len(run.outcome.processes) >= 7
    digests.add(run.outcome.digest)

@pytest.mark.affinet_runtime("inprocess")
def test_here(swarm):
    run = swarm(*AIR).fly()
    assert not run.outcome.processes
    digests.add(run.outcome.digest)

def test_same_bits():
    assert len(digests) == 1
"""
    assert outcomes(tested(text, "--affinet-runtime=processes")) == {"passed": 3}


def test_a_runtime_that_is_none_is_refused(tested):
    result = tested("def test_nothing(): pass", "--affinet-runtime=thread")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--affinet-runtime: invalid choice: 'thread'*"])


@pytest.mark.parametrize(
    ("mark", "says"),
    [
        # flew over processes, and passed
        (
            'runtime("in-process")',
            "affinet_runtime('in-process'): write affinet_runtime('inprocess') or affinet_runtime('proc",
        ),
        ("runtime(None)", "affinet_runtime(None): write affinet_runtime('inprocess')"),
        ('runtime("inprocess", "processes")', "affinet_runtime('inprocess', 'processes'): write"),
        # an IndexError in the fixture, or the runtime of the command line
        ("runtime()", "affinet_runtime(): write affinet_runtime('inprocess')"),
        ('runtime(name="inprocess")', "affinet_runtime has no keyword 'name': write"),
        # a test that was skipped for want of seeds
        ("seeds()", "affinet_seeds has no seed: write affinet_seeds(1, 2, 3), different whole numbers"),
        # errors of the scenario, or nothing
        ('seeds(1, "2")', "affinet_seeds: '2' is no seed: write"),
        ("seeds(1.0)", "affinet_seeds: 1.0 is no seed"),
        ("seeds(True)", "affinet_seeds: True is no seed"),
        ("seeds([1, 2])", "affinet_seeds: [1, 2] is no seed"),
        ("seeds(1, -1)", "affinet_seeds: -1 is no seed"),
        (f"seeds({2**64})", "affinet_seeds: 18446744073709551616 is no seed"),
        ("seeds(3, 1, 3)", "affinet_seeds: 3 is given twice: write"),
        ("seeds(1, scope=2)", "affinet_seeds has no keyword 'scope': write"),
    ],
    ids=lambda given: given if "write" not in given else "",
)
def test_a_mark_that_says_what_cannot_be_is_refused_when_tests_are_collected(tested, mark, says):
    text = f"""
@pytest.mark.affinet_{mark}
def test_marked(swarm):
    assert False, "it ran"
"""
    result = tested(text)
    assert outcomes(result) == {"errors": 1}
    output = result.stdout.str()
    assert f"::test_marked: {says}" in output
    assert "it ran" not in output
    assert "Traceback" not in output


@pytest.mark.slow
def test_workers_fly_swarms_and_report_what_failed(pytester):
    pytester.makepyfile(f"""
def test_flies(swarm):
    swarm({SHORT}).fly()

def test_breaks(swarm):
    swarm({SHORT}).fly("fail")
""")
    result = pytester.runpytest_subprocess("-n", "2")
    assert outcomes(result) == {"passed": 1, "failed": 1}
    ((_, _, recording, _),) = SAYS_WHERE.findall(result.stdout.str())
    assert Path(recording).is_file()


def test_the_marks_are_known(tested):
    result = tested(f"""
@pytest.mark.affinet_seeds(1)
@pytest.mark.affinet_runtime("inprocess")
def test_flies(swarm):
    swarm({SHORT}).fly()
""", "--strict-markers")  # fmt: skip
    assert outcomes(result) == {"passed": 1}


# ---- many seeds


def test_of_many_seeds_that_fail_the_worst_is_kept_and_each_has_a_command(tested, pytester, capsys):
    text = """
def test_split(swarm):
    split = swarm("corridor", "time.dt=0.05", "time.duration=3", "agents.estimator=none")
    split.fault("partition", groups="leaders", at=0.5, until=1.5).fly(seeds=4).check(bounded(1.5), share=0.9)
"""
    result = tested(text)
    assert outcomes(result) == {"failed": 1}
    said = result.stdout.str()
    seed, runtime, recording, again = SAYS_WHERE.search(re.sub(r", the worst of \d+ that fail,", ",", said)).groups()
    assert (runtime, Path(recording).exists()) == ("processes", True)
    others = re.findall(r"^affinet (replay .+ --seed (\d+))$", said, re.MULTILINE)
    assert {int(other) for _, other in others} == {1, 2, 3, 4} - {int(seed)}
    assert main([*shlex.split(again), "--runtime", "inprocess", "--out", str(pytester.path / "again")]) == 0
    assert main([*shlex.split(others[0][0]), "--out", str(pytester.path / "other"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["flown"]["seed"] == int(others[0][1])


def test_many_seeds_that_are_asked_nothing_are_an_error(tested):
    assert outcomes(tested(f"def test_nothing(swarm): swarm({SHORT}).fly(seeds=3)")) == {"passed": 1, "errors": 1}


def test_a_whole_suite_flies_with_so_many_seeds(tested):
    text = f"""
@pytest.mark.affinet_seeds(7)
def test_marked(swarm):
    assert swarm({SHORT}).fly().plan.scenario.seed == 7

def test_plain(swarm):
    assert swarm({SHORT}).fly().plan.scenario.seed in (1, 2, 3)

def test_without():
    pass
"""
    result = tested(text, "--affinet-seeds=3", "-v")
    assert outcomes(result) == {"passed": 5}
    result.stdout.fnmatch_lines(["*test_plain?seed1?*", "*test_plain?seed2?*", "*test_plain?seed3?*"])
    for number in ("0", "10001", "99999999"):
        assert tested(text, f"--affinet-seeds={number}").ret != 0


def test_a_test_of_a_suite_with_so_many_seeds_is_checked_again_by_the_command_that_it_says(tested, pytester):
    text = f"""
def test_breaks(swarm):
    run = swarm({SHORT}).fly()
    run.check(bounded(1e-9 if run.plan.scenario.seed == 2 else 9))
"""
    (said,) = CHECK_AGAIN.findall(tested(text, "--affinet-seeds=3").stdout.str())
    again = pytester.runpytest_inprocess(f"--basetemp={pytester.path / 'base'}", *shlex.split(said))
    assert outcomes(again) == {"failed": 1}
    again.stdout.fnmatch_lines(["seed 2, inprocess"])
