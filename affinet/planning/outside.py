"""What cannot be where physics is not simulated: recorded and external flights know velocities and relative positions alone."""

from __future__ import annotations

from collections.abc import Sequence

from affinet.scenario.sections import Scenario, ScenarioError
from netem.faults.fault import Fault, Verb
from world.physics.world import World


def refuse(given: Scenario, world: World, faults: Sequence[Fault]) -> None:
    """Refuse what a world that is not simulated does not have.

    Raises
    ------
    ScenarioError
        Naming the key.
    """
    if given.world == "simulated":
        return
    where = f"a world that is {given.world}"
    if world.body.build().order != 1 or given.dynamics.model != "single-integrator":
        raise ScenarioError(f"dynamics.model: in {where} the input is a velocity: leave it a single-integrator")
    if given.target is not None:
        raise ScenarioError(f"target: nobody says where one is in {where}: leave it out")
    if any(fault.verb is Verb.GUST for fault in faults):
        raise ScenarioError(f"timeline: a gust cannot push bodies in {where}: leave it out")
