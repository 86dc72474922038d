"""What goes wrong in the air: links that carry one way, split brains, jams, bursts, and maps that come late."""

import pytest

from affinet import agreement, always, bounded, converged, never_heard_across_a_cut, quantity, recovers

ERROR = quantity("error")
COARSE = "time.dt=0.05"
FILTER_ALONE = "agents.estimator=rkf"


def test_a_leader_that_is_not_heard_costs_more_than_a_leader_that_does_not_hear(swarm):
    """An antenna in its own shadow sends and does not receive, or the other way round: only one of them is urgent."""
    air = swarm("corridor", COARSE, "time.duration=16")
    mute = air.fault("cut", links=["2->4"], at=8, until=11).fly()
    mute.check(never_heard_across_a_cut(), recovers(0.2, within=4.5), bounded(4))
    deaf = air.fault("cut", links=["4->2"], at=8, until=11).fly()
    deaf.check(never_heard_across_a_cut(), always(ERROR < 0.2, since=8))


@pytest.mark.affinet_seeds(1, 2, 3)
def test_a_swarm_split_from_its_leaders_finds_back_when_the_split_heals(swarm):
    """Leaders turn behind a wall: followers coast on the geometry they share, filters alone fly off."""
    air = ("corridor", COARSE, "time.duration=17")
    split = swarm(*air).fault("partition", name="split", groups="leaders", at=8)
    together = split.fault("heal", at=11, names=["split"]).fly()
    together.check(never_heard_across_a_cut(), bounded(2), converged(0.3, by=15))
    alone = swarm(*air, FILTER_ALONE).fault("partition", groups="leaders", at=8, until=11).fly()
    alone.check(~bounded(40))


def test_bursts_in_the_turn_are_bridged_by_the_geometry(swarm):
    """A turn is when antennas point elsewhere, and when guessing that nothing changes is most wrong."""
    air = ("partition", COARSE, "time.duration=28", "timeline=[]")
    bursts = {"links": ["all"], "profile": "jammed", "at": 18, "until": 24}
    swarm(*air).fault("degrade", **bursts).fly().check(bounded(3), recovers(0.15, within=3.5))
    swarm(*air, FILTER_ALONE).fault("degrade", **bursts).fly().check(~bounded(50))


@pytest.mark.affinet_seeds(1, 2, 3)
def test_a_jammed_corridor_is_flown_through(swarm):
    """A jammer by the road leaves one message in ten to fly by, for as long as it takes to pass it."""
    air, jam = ("corridor", COARSE, "time.duration=18"), {"links": ["all"], "loss": 0.9, "at": 8, "until": 12}
    swarm(*air).fault("lose", **jam).fly().check(bounded(4), recovers(0.2, within=5.5))
    swarm(*air, FILTER_ALONE).fault("lose", **jam).fly().check(~bounded(8))


def test_maps_that_come_late_in_the_turn_raise_the_alarm_and_not_the_error(swarm):
    """A relay adds a second: what neighbours say of the shape was true before they turned, and psi must tell."""
    only_maps_travel = ("partition", COARSE, "time.duration=25", "timeline=[]", "agents.law=constant-velocity")
    prompt = swarm(*only_maps_travel).fly().check(agreement(0.5, by=18))
    late = swarm(*only_maps_travel).fault("delay", links=["all"], delay=1.0, at=18, until=24).fly()
    late.check(~agreement(0.5, by=18), always(2 * prompt.error[prompt.tick(18) :].max() > ERROR, since=18))


def test_a_split_that_waits_for_calm_strikes_when_all_is_well(swarm):
    """Faults that come in the first seconds hide behind the transient: this one waits for something to lose."""
    calm = {"tracking_error_below": 0.05, "lasting": 1.0}
    air = swarm("corridor", COARSE, "time.duration=17")
    run = air.fault("partition", groups="leaders", when=calm, lasts=3).fly()
    struck = run.tick(run.bites[0].at)
    assert (run.error[struck - 20 : struck] < 0.05).all()
    run.check(~always(ERROR < 0.15, since=8), bounded(1.5), converged(0.3, by=15))
