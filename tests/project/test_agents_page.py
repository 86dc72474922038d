"""docs/agents.md shows what is: its commands run, its code is the example's, its cases are those of the suite."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from flying import PROCESSES
from paths import DOCS

from affinet.conformance.suite import CASES
from affinet.scenario.programs import of_agents

pytestmark = PROCESSES

PAGE = (DOCS / "agents.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    (affinet .*)$", PAGE, flags=re.MULTILINE)


def says(said):
    return " ".join(said.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_page_passes(command, tmp_path):
    if "node " in command and shutil.which("node") is None:
        pytest.skip("there is no node on the path")
    (tmp_path / "docs").symlink_to(DOCS)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        shlex.split(command), cwd=tmp_path, env=os.environ | {"PATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "pass" in done.stdout


def test_the_page_has_commands():
    assert [command.split()[1] for command in COMMANDS] == ["run", "conformance", "conformance"]


def test_the_code_of_the_page_is_the_examples():
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    example = (DOCS / "examples" / "agent.py").read_text(encoding="utf-8")
    assert says(code) in says(example)


def test_the_programs_of_the_page_are_some():
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
    programs = tomllib.loads(text)["agents"]["programs"]
    assert of_agents(programs) == programs


def test_the_cases_of_the_page_are_those_of_the_suite():
    rows = re.findall(r"^\| `([a-z-]+)` \| (.*?) \| (.*?) \|$", PAGE, flags=re.MULTILINE)
    assert rows == [(case.name, case.demand, case.section) for case in CASES]


def test_the_report_of_the_page_says_what_the_suite_says():
    (report,) = re.findall(r"```\n(\$ affinet conformance.*?)```", PAGE, flags=re.DOTALL)
    demands = dict(re.findall(r"^([a-z-]+): it has to (.*)$", report, flags=re.MULTILINE))
    assert demands == {case.name: case.demand for case in CASES if case.name in demands}
    assert re.search(rf"^{len(CASES) - len(demands)} pass, {len(demands)} fail$", report, flags=re.MULTILINE)
