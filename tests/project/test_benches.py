"""Every script in bench/ runs, at its smallest size."""

import subprocess
import sys

import pytest
from flying import PROCESSES
from paths import BENCH, ROOT

pytestmark = PROCESSES

SMALLEST = {
    "closed_loops": (
        ("paper-000-fig12cd", "--cases", "6"),
        "| zhao7, constant velocity, ral | ral | 0: -0.591, 12: -2.17, 28: 0, 44: 0 |\n"
        "| zhao7, constant velocity, conral | conral | 0: -0.591, 12: -2.16, 28: -0.707, 44: -0.999 |\n",
    ),
    "leaders": (("--swarms", "swarm50"), "| swarm50 | 8 | 7.0 | "),
    "all": (
        ("--only", "runs", "tick7", "growth", "--rounds", "1", "--share", "0.03"),
        "| tick over processes of 5 agents each, 10 to 40 agents of 4 neighbours | ",  # the last of them
    ),
    "verdicts": (("--ticks", "2", "--rounds", "1"), "| 60 of 10 agents | 4 | "),
}
ELSEWHERE = {
    "accuracy": "netem/impairments/test_models.py",
    "endurance": "system/test_endurance.py",
    "kills": "system/test_kills.py",
    "redcho": "system/test_redcho.py",
}


def test_no_script_is_left_out():
    scripts = {file.stem for file in BENCH.glob("*.py") if '__name__ == "__main__"' in file.read_text()}
    assert scripts == {*SMALLEST, *ELSEWHERE}
    assert all(f'"{script}.py"' in (ROOT / "tests" / file).read_text() for script, file in ELSEWHERE.items())


# All together take as long as each of them, and what tests of their own have been through already.
@pytest.mark.parametrize(
    "script", [pytest.param(script, marks=[pytest.mark.slow] if script == "all" else []) for script in SMALLEST]
)
def test_a_script_runs_at_its_smallest_size(script):
    # A script died of a TypeError: messages had got fields it did not give.
    size, row = SMALLEST[script]
    command = [sys.executable, str(BENCH / f"{script}.py"), *size]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert row in done.stdout
