"""Programs of a user's own that a scenario names: each of an agent that there is, and over processes only."""

import pytest
from flying import plan_of

from affinet.cli import commands, status
from affinet.planning.plan import PlanError
from affinet.runtimes import launcher
from affinet.runtimes.launcher import Launcher
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario.wrong import ScenarioError

FLOWN = """agents.programs={ "2" = "python 'my agent.py' --fast" }"""


def test_a_command_line_is_read_as_a_shell_does():
    assert plan_of("corridor", FLOWN).programs == {2: ["python", "my agent.py", "--fast"]}
    assert plan_of("corridor").programs == {}


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ('{ "8" = "true" }', "agents.programs.8: there is no agent 8; they are 1 to 7"),
        ('{ "0" = "true" }', "agents.programs.0: there is no agent 0; they are 1 to 7"),
        ('{ "03" = "true" }', "agents.programs: '03' is no agent"),
        ('{ "two" = "true" }', "agents.programs: 'two' is no agent"),
        ('{ "2" = " " }', "agents.programs: an empty command line starts nothing"),
        ('{ "2" = "a \\"" }', "is no command line: no closing quotation"),
    ],
)
def test_what_is_no_program_of_an_agent_is_refused(given, says):
    with pytest.raises(ScenarioError) as refused:
        plan_of("corridor", f"agents.programs={given}")
    assert says in str(refused.value)


def test_programs_fly_over_processes_only(tmp_path):
    plan = plan_of("corridor", FLOWN)
    for flies_in_process in (lambda: rehearse(plan), lambda: fly(plan, "inprocess", tmp_path / "run", lambda *_: None)):
        with pytest.raises(PlanError, match=r"^programs: agents 2 fly by programs of your own"):
            flies_in_process()
    assert not (tmp_path / "run").exists()


def test_the_command_refuses_them_in_process_before_it_makes_a_directory(tmp_path, capsys):
    out = tmp_path / "run"
    given = ["run", "corridor", "--runtime", "inprocess", "--set", FLOWN, "--out", str(out)]
    assert commands.main(given) == status.BAD_INPUT
    assert capsys.readouterr().err.startswith("programs: agents 2 fly by programs of your own")
    assert not out.exists()


def test_an_agent_that_a_program_flies_is_in_no_host(tmp_path):
    plan = plan_of("corridor", FLOWN, "agents.per_process=3")
    assert launcher.hosts_of(plan, plan.programs) == {1: (1, 3, 4), 2: (5, 6, 7)}
    assert 2 in Launcher(plan, tmp_path, watch=lambda *_: None)._lone
