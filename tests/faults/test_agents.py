"""What goes wrong with agents: they die, forget, stall, lie, lose the time, see nothing new, drift, and leave."""

import numpy as np
import pytest

from affinet import agreement, always, bounded, collision_free, quantity, recovers

ERROR = quantity("error")
COARSE = "time.dt=0.05"
FILTER_ALONE = "agents.estimator=rkf"


@pytest.mark.affinet_seeds(1, 2, 3)
def test_the_shape_outlasts_the_agent_that_keeps_it_rigid(swarm):
    """The one whose loss breaks rigidity will be lost some day: the others must hold the shape until it is back."""
    air = ("partition", COARSE, "time.duration=18.5", "timeline=[]")
    lost, meanwhile = {"agents": ["critical"], "at": 8, "until": 14}, {"since": 8, "until": 13.9}
    swarm(*air).fault("depart", **lost).fly().check(always(ERROR < 1, **meanwhile), recovers(0.2, within=4))
    swarm(*air, FILTER_ALONE).fault("depart", **lost).fly().check(~always(ERROR < 5, **meanwhile))


def test_a_killed_agent_that_forgot_everything_finds_its_place_again(swarm):
    """A watchdog restarts the process in flight: it knows nothing, and its neighbours did not wait."""
    run = swarm("corridor", COARSE, "time.duration=15.5").fault("kill", agents=[5], at=8)
    run.fault("restart", agents=[5], at=11).fly().check(recovers(0.2, within=4), bounded(2))


def test_an_agent_that_kept_its_state_is_back_sooner_than_one_that_did_not(swarm):
    """Whoever learns the swarm's velocity by integrating pays for amnesia long after the reboot."""
    gains = "agents.parameters.constant-velocity={ alpha = 10.0, eta = 0.1 }"
    killed = swarm("switching", COARSE, gains, "time.duration=32", "timeline=[]").fault("kill", agents=[6], at=26)
    cold = killed.fault("restart", agents=[6], at=27, state="cold").fly()
    warm = killed.fault("restart", agents=[6], at=27, state="warm").fly()
    afterwards = slice(cold.tick(28), None)
    assert (cold.present & warm.present)[afterwards].all()
    assert 5 * warm.error[afterwards].mean() < cold.error[afterwards].mean()


def test_agents_that_stall_catch_up_without_what_they_were_told_meanwhile(swarm):
    """A garbage collector, a swapped page, a lease that ran out: sessions are gone, and the body flew on."""
    stalled = swarm("corridor", COARSE, "time.duration=16.5")
    run = stalled.fault("pause", agents=[5, 6], at=8, until=12, in_flight="drop").fly()
    run.check(recovers(0.2, within=4), bounded(3))


def test_a_liar_moves_those_who_believe_and_not_those_who_measure(swarm):
    """A compromised agent tells a map three times too large: the filters see that nobody agrees, and go on."""
    lie, shaken = {"agents": [4], "matrix": [[3.0, 0.0], [0.0, 3.0]], "at": 8, "until": 14}, ERROR < 1.5
    wary = swarm("corridor", COARSE, "time.duration=15").fault("lie", **lie).fly()
    wary.check(~agreement(1.0, by=3), always(shaken, since=8))
    gullible = swarm("corridor", COARSE, "time.duration=15", "agents.estimator=conral").fault("lie", **lie).fly()
    gullible.check(~always(shaken, since=8))


def test_a_leader_whose_clock_gains_is_followed_and_comes_back(swarm):
    """Leaders fly by the clock: one that lost its satellites runs ahead, and bends the formation until set right."""
    run = swarm("corridor", COARSE, "time.duration=16.5").fault("clock", agents=[1], rate=0.2, at=8, until=12)
    run.fly().check(recovers(0.2, within=4), bounded(2))


def test_a_gust_displaces_the_swarm_by_what_its_gain_gives_way_and_no_more(swarm):
    """Wind of 1 m/s against a pull of 1 1/s: all of them stand 1 m off while it blows, in shape, and return."""
    run = swarm("corridor", COARSE, "time.duration=19", "network.availability=1")
    flown = run.fault("gust", agents=["all"], velocity=[0.0, 1.0], at=8, until=14).fly()
    assert flown.error[flown.tick(13)] == pytest.approx(1.0, rel=0.3)
    flown.check(recovers(0.2, within=4.5))


def test_a_sensor_that_repeats_itself_is_survived(swarm):
    """A camera that hangs delivers the last image for ever: the numbers look healthy, and are old."""
    run = swarm("corridor", COARSE, "time.duration=16.5").fault("freeze", links=["all->4"], at=8, until=12)
    run.fly().check(recovers(0.25, within=4), bounded(5))


def test_a_blind_agent_keeps_its_place_by_what_it_is_told(swarm):
    """Sun in the lens of one agent: it measures nothing for seconds, and hears its neighbours all the same."""
    air, blind = ("corridor", COARSE, "time.duration=13"), {"links": ["all->6"], "at": 8, "until": 12}
    seeing = swarm(*air).fly()
    led = swarm(*air).fault("dropout", **blind).fly()
    assert 0 < abs(led.error - seeing.error).max() < 0.3
    swarm(*air, FILTER_ALONE).fault("dropout", **blind).fly().check(~bounded(40))


def test_a_body_adrift_stays_clear_where_one_that_hovers_is_run_over(swarm):
    """The foremost agent gives up: without a law it must at least not stop in the way of those behind it."""
    air = swarm("hexa", COARSE, "time.duration=18", "formation.spread=0.3")
    adrift = air.fault("depart", agents=[1], at=12, body="drift").fly().check(collision_free(0.4))
    assert np.abs(np.diff(adrift.position[adrift.tick(12) :, 0], n=2, axis=0)).max() < 1e-9
    air.fault("depart", agents=[1], at=12, body="hold").fly().check(~collision_free(0.4))
