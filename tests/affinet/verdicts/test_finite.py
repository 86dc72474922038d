"""Of a run that left the numbers it is said where: which agent, in which tick."""

import numpy as np
import pytest
from flying import plan_of

from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts import finite


@pytest.fixture(scope="module")
def run():
    return rehearse(plan_of("corridor", "time.dt=0.05", "time.duration=1"))


def spoilt(run, **places):
    arrays = {name: np.array(array) for name, array in run.arrays.items()}
    for name, place in places.items():
        arrays[name][place] = np.nan
    return arrays


def test_of_numbers_nothing_is_said(run):
    assert finite.diverged(run.plan, run.arrays) is None
    assert finite.unknown(run.plan, run.arrays) is None


@pytest.mark.parametrize(
    ("places", "says"),
    [
        ({"position": (slice(7, None), 4)}, "the position of agent 5 is not a number any more in tick 7 (0.35 s)"),
        ({"position": (20, 6)}, "the position of agent 7 is not a number any more in tick 20 (1 s)"),
        (
            {"position": (7, 4), "estimate": (slice(6, None), 3)},
            "the position of agent 5 is not a number any more in tick 7 (0.35 s), "
            "after an estimate of agent 4 in tick 6 (0.3 s)",
        ),
        (
            {"position": (7, 4), "estimate": (slice(8, None), 3)},
            "the position of agent 5 is not a number any more in tick 7 (0.35 s)",
        ),
    ],
)
def test_it_is_said_whose_position_was_first_no_number(run, places, says):
    assert finite.diverged(run.plan, spoilt(run, **places)) == f"the swarm diverged: {says}"


def test_it_is_said_whose_estimate_was_first_no_number_where_there_is_one(run):
    agent, slot = np.argwhere(run.arrays["known"][9])[0]
    arrays = spoilt(run, estimate=(slice(9, None), agent, slot))
    assert (
        finite.unknown(run.plan, arrays)
        == f"an estimate of agent {agent + 1} in tick 9 (0.45 s) is not a number any more"
    )
    arrays["known"][:] = False
    assert finite.unknown(run.plan, arrays) is None
