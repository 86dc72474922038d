"""What cannot be where physics is not simulated: recorded and external flights know velocities and relative positions alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from analysis.models.finding import Finding
from netem.faults.fault import Fault, Verb
from netem.faults.trigger import Trigger
from netem.impairments.profile import Profile
from world.physics.world import World


def refuse(given: Scenario, faults: Sequence[Fault]) -> None:
    """Refuse what a world that is not simulated does not have.

    Raises
    ------
    ScenarioError
        Naming the key.
    """
    if given.world == "simulated":
        return
    where = f"a world that is {given.world}"
    if given.dynamics.model != "single-integrator":
        raise ScenarioError(f"dynamics.model: in {where} the input is a velocity: leave it a single-integrator")
    if given.target is not None:
        raise ScenarioError(f"target: nobody says where one is in {where}: leave it out")
    if any(fault.verb is Verb.GUST for fault in faults):
        raise ScenarioError(f"timeline: a gust cannot push bodies in {where}: leave it out")


def refuse_unknown_places(world: World, profiles: Sequence[Profile], triggers: Sequence[Trigger]) -> None:
    """Refuse what goes by where agents are in a flight that does not say so.

    Raises
    ------
    ScenarioError
        Naming the key.
    """
    if world.flight is None or world.flight.has_reference:
        return
    where = "a recorded flight without positions of all agents"
    if any(profile.spatial for profile in profiles):
        raise ScenarioError(f"network: losses by distance and jammed zones need a reference, and this is {where}")
    if triggers:
        raise ScenarioError(f"timeline: what waits for the tracking error needs a reference, and this is {where}")


def gaps(world: World) -> list[Finding]:
    """How much of a recorded flight was not measured."""
    if world.flight is None:
        return []
    share = float(np.isnan(world.flight.measured).any(axis=-1).mean())
    says = f"{share:.1%} of the measurements of {world.ticks} ticks are gaps: nothing is measured there"
    return [Finding("recorded", "note", says)] if share else []
