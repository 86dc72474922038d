"""A sample of `bench/kills.py`, which kills any process of a run at any moment and looks at what is left."""

import subprocess
import sys

import pytest
from flying import PROCESSES
from networks import skip_without
from paths import BENCH

pytestmark = PROCESSES

KILLS = BENCH / "kills.py"


def killed(role, moment, *options):
    command = [sys.executable, str(KILLS), "--kills", "1", "--only", role, "--moments", moment, moment, *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


# Seconds from the victim's start: the launcher while its children log in, nursery and world while they import, the
# others in flight.
@pytest.mark.parametrize(
    ("role", "moment"),
    [
        ("launcher", "2.2"),
        ("world", "0.5"),
        pytest.param("nursery", "0.3", marks=pytest.mark.slow),
        pytest.param("netem", "3", marks=pytest.mark.slow),
        pytest.param("agent", "3.5", marks=pytest.mark.slow),
    ],
)
def test_a_kill_at_any_moment_leaves_nothing_but_what_can_be_read(role, moment):
    bench = killed(role, moment)
    assert bench.returncode == 0, bench.stdout + bench.stderr


# By seed 1 the medium is on the machine of the launcher, by seed 2 on the other one.
@pytest.mark.slow
@pytest.mark.parametrize("seed", ["1", "2"])
@pytest.mark.parametrize("role", ["launcher", "command", "everybody"])
def test_over_machines_all_but_the_last_second_is_there_whoever_is_killed(role, seed):
    # Of a medium on another machine nothing was, when the launcher or all were killed.
    skip_without()
    bench = killed(role, "2.5", "--over", "namespaces", "--seed", seed)
    assert bench.returncode == 0, bench.stdout + bench.stderr


@pytest.mark.slow
def test_a_machine_that_has_not_joined_yet_does_not_keep_a_failed_run_from_ending():
    # It hears nobody say that the run is over, and was waited for.
    skip_without()
    bench = killed("command", "1.5", "--over", "namespaces", "--since", "start", "--seed", "2")
    assert bench.returncode == 0, bench.stdout + bench.stderr


@pytest.mark.parametrize("moment", ["1.8", pytest.param("2.6", marks=pytest.mark.slow)])
def test_ctrl_c_while_it_starts_leaves_in_order(moment):
    bench = killed("ctrl-c", moment)
    assert bench.returncode == 0, bench.stdout + bench.stderr


def test_a_row_that_is_not_ok_says_what_was_wrong_and_how_to_see_it_again(tmp_path):
    scenario = tmp_path / "brief.toml"
    scenario.write_text("this cannot fly")
    bench = killed("launcher", "60", "--scenario", str(scenario), "--seed", "7")
    assert bench.returncode == 1
    assert "| launcher | 1 | 1 | 1 | 0 |" in bench.stdout
    assert "--seed 7: launcher after 60.000 s: it had ended before it was killed" in bench.stdout
