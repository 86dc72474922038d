"""A user's own code in a forked agent: what it does to its process, it does to that alone, and it is said."""

import json
import subprocess
import sys

import pytest
from flying import PROCESSES, TRIANGLE
from own_code import ESTIMATOR, broken

pytestmark = PROCESSES

# Planning imports the module too, in the launcher: this is for the second agent alone.
SECOND = "if open('/proc/self/comm').read() == 'agent 2\\n':\n    "
LATE = (
    "late = np.max(own.tick) >= 7",
    "late = np.max(own.tick) >= 7 and open('/proc/self/comm').read() == 'agent 2\\n'",
)


def flown(tmp_path, text):
    (tmp_path / "mine.py").write_text(text)
    (tmp_path / "triangle.toml").write_text(TRIANGLE)
    command = ["run", "triangle.toml", "--estimator", "mine:Own", "--out", "run", "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "affinet", *command], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize(
    ("change", "status", "reason"),
    [
        pytest.param(
            ("import sys", f"import ctypes\nimport sys\n{SECOND}ctypes.string_at(0)"),
            1,
            "agent 2 (pid {pid}) was killed by SIGSEGV. It had said nothing.",
            id="crashes while imported",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            ("import sys", f"import os\nimport sys\n{SECOND}os._exit(5)"),
            1,
            "agent 2 (pid {pid}) was ended with exit status 5. It had said nothing.",
            id="ends while imported",
        ),
        pytest.param(
            ("import sys", f"import sys\n{SECOND}sys.exit(0)"),
            3,
            "agent 2: importing mine: it called sys.exit(), and only the run may end the run ({folder}/mine.py:3)",
            id="exits while imported",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            ("return state, estimate", "return state, __import__('ctypes').string_at(0) if late else estimate"),
            1,
            "agent 2 (pid {pid}) was killed by SIGSEGV. It had said nothing.",
            id="crashes in flight",
        ),
    ],
)
def test_what_it_does_to_its_process_is_said(change, status, reason, tmp_path):
    returned, summary = flown(tmp_path, broken(ESTIMATOR, LATE, change))
    (pid,) = (process["pid"] for process in summary["processes"] if process["id"] == 2)
    (said,) = summary["reasons"]
    assert said.startswith(reason.format(pid=pid, folder=tmp_path))
    assert returned == status
    # The others were asked to leave, and the nursery left last.
    assert {process["exit"] for process in summary["processes"] if process["role"] == "nursery"} == {0}
