"""Many runs side by side leave what each leaves alone: every array and the whole verdict, whatever air and faults they have."""

from dataclasses import replace

import numpy as np
import pytest
from flying import plan_of
from own_code import ESTIMATOR, broken, write

from affinet.runtimes import rehearsing
from affinet.runtimes.rehearsing import rehearse, rehearse_all, why_alone
from netem.processes.user_code import UserCodeError

SHORT = ("time.dt=0.05", "time.duration=3")
WILD = (
    'network.profile="wild"',
    'network.profiles.wild={like="wifi_busy",duplicate=0.1,reorder=0.1,corrupt=[{kind="bias",p=0.1,by=0.2}]}',
)
LATE = ("network.delay_ticks=2", "network.coupled=false")
SCRIPTS = (
    'timeline=[{verb="kill",at=0.5,agents=[5]},{verb="restart",at=1.0,agents=[5],state="warm"},'
    '{verb="partition",at=1.0,lasts=0.5,groups="leaders",in_flight="hold"},{verb="lose",at=1.2,links=["all"],loss=0.4}]',
    'timeline=[{verb="lose",at=0.2,lasts=1,links=["random 4"],loss=0.6},{verb="delay",at=0.5,lasts=1,links=["4"],delay=0.1},'
    '{verb="gust",at=2,lasts=0.3,agents=["random 2 followers"],velocity=[0.5,0]},{verb="pause",at=1,agents=[6]}]',
    'timeline=[{verb="outlier",at=0,links=["all"],p=0.1,sigma=1},{verb="freeze",at=1,lasts=1,links=["4"]},'
    '{verb="dropout",at=1.2,links=["4"],p=0.5},{verb="depart",at=0.5,agents=[7],body="drift"},'
    '{verb="lie",agents=[4],matrix=[[1.5,0],[0,1]],at=0.3,lasts=1},{verb="clock",agents=["leaders"],rate=0.1,at=1}]',
    'timeline=[{verb="cut",at=9,links=["1-2"]}]',
    "timeline=[]",
)
# Faults that are judged again, in other places and at other times of each run, over each other too.
LOSSES = (
    'timeline=[{verb="lose",at=0.2,lasts=1,links=["all"],loss=0.5},{verb="lose",at=0.5,lasts=1,links=["4"],loss=0.7}]',
    'timeline=[{verb="cut",at=0.1,lasts=0.4,links=["2->4"]},{verb="dropout",at=0.3,links=["all"],p=0.4},'
    '{verb="lose",at=2,links=["leaders"],loss=0.3}]',
    'timeline=[{verb="degrade",at=1,lasts=1,links=["all"],profile="wifi_clear"},{verb="lose",at=1.5,links=["2-4"],loss=0}]',
    "timeline=[]",
)
SWARMS = {
    "losses": [("corridor", *WILD, script, f"seed={seed}") for seed in (1, 7) for script in (*LOSSES[:2], LOSSES[3])],
    "degraded": [("corridor", *WILD, LOSSES[2], f"seed={seed}") for seed in (1, 7)],
    "air": [("corridor", *LATE, f"seed={seed}") for seed in (1, 7, 2**63 + 5)],
    "wild": [("corridor", *WILD, f"seed={seed}") for seed in (1, 7)],
    "faults": [("corridor", *WILD, script, f"seed={seed}") for seed in (1, 7) for script in SCRIPTS],
    "faults-ga-rkf": [("corridor", 'agents.estimator="ga-rkf"', script) for script in SCRIPTS],
    "localization": [("localization", f"seed={seed}", script) for seed in (3, 4) for script in SCRIPTS[:1]],
    "target": [("target", "time.duration=1", f"seed={seed}") for seed in (3, 4)],
    "centre": [("corridor", 'agents.estimator="crkf"', f"seed={seed}") for seed in (3, 4)],
    "space": [("ravine", f"seed={seed}") for seed in (3, 4)],
    "waiting": [
        ("corridor", f"seed={seed}", 'timeline=[{verb="cut",links=["4"],when={tracking_error_below=0.3},lasts=1}]')
        for seed in (3, 4)
    ],
    "mixed": [
        ("corridor", f"seed={seed}", f'agents.estimator="{name}"') for seed in (3, 4) for name in ("rkf", "conral")
    ],
}


# How many swarms fly: one for those that are alike; how late a message may be, by its faults, is told all agents of one.
TIMES = dict.fromkeys(SWARMS, 1) | {"faults": 3, "faults-ga-rkf": 3, "mixed": 2, "waiting": 2}


@pytest.fixture
def flown(monkeypatch):
    """The plans that have flown, batches among them."""
    plans, swarm = [], rehearsing.InProcessSwarm

    def counted(plan):
        plans.append(plan)
        return swarm(plan)

    monkeypatch.setattr(rehearsing, "InProcessSwarm", counted)
    return plans


@pytest.mark.parametrize("swarm", SWARMS.values(), ids=SWARMS)
def test_each_of_many_leaves_what_it_leaves_alone(swarm):
    plans = [plan_of(name, *SHORT, *overrides) for name, *overrides in swarm]
    for plan, together in zip(plans, rehearse_all(plans), strict=True):
        alone = rehearse(plan)
        assert together.plan is plan
        assert together.arrays.keys() == alone.arrays.keys()
        for name, array in alone.arrays.items():
            np.testing.assert_array_equal(together.arrays[name], array, name)
            assert together.arrays[name].dtype == array.dtype
        assert replace(together.outcome, wall_s=0.0, timeline=None) == replace(alone.outcome, wall_s=0.0, timeline=None)
        assert together.timeline.faults == alone.timeline.faults


@pytest.mark.parametrize("name", SWARMS)
def test_those_that_are_alike_fly_at_once(name, flown):
    plans = [plan_of(scenario, *SHORT, *overrides) for scenario, *overrides in SWARMS[name]]
    rehearse_all(plans)
    assert len(flown) == TIMES[name]


def test_no_more_fly_at_once_than_there_is_room_for(flown, monkeypatch):
    plans = [plan_of("corridor", *SHORT, f"seed={seed}") for seed in range(7)]
    monkeypatch.setattr(rehearsing, "_MOST", 3)
    digests = [run.outcome.digest for run in rehearse_all(plans)]
    assert [plan.world.swarms for plan in flown] == [3, 3, 1]
    monkeypatch.setattr(rehearsing, "_BYTES", 1)
    assert [run.outcome.digest for run in rehearse_all(plans)] == digests
    assert [plan.world.swarms for plan in flown[3:]] == [1] * 7


def test_why_runs_fly_alone_is_said():
    waiting = plan_of("corridor", *SHORT, *SWARMS["waiting"][0][2:])
    assert why_alone(waiting) == "a fault that waits for a condition comes at another time in each run"
    assert why_alone(plan_of("corridor", *SHORT)) is None


def test_who_is_wrong_in_a_batch_is_told_as_alone(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    name = write(tmp_path, broken(ESTIMATOR, ("late = np", "late = np.max(own.tick) > 3 and 1 / 0 or np")))
    own = ("agents.law=rest", f'agents.estimator="{name}:Own"')
    plans = [plan_of("corridor", *SHORT, *own, f"seed={seed}") for seed in (1, 2, 3)]
    with pytest.raises(UserCodeError) as alone:
        rehearse(plans[0])
    with pytest.raises(UserCodeError) as together:
        rehearse_all(plans)
    assert str(together.value) == str(alone.value)
    assert "tick 4" in str(alone.value)
