"""The estimator and the law of a scenario: chosen, asked what they find, and refused where they want what is not given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from affinet.planning import checks, registry
from affinet.scenario.bodies import INTEGRATORS
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from agents.centre.checked import CheckedCentre
from agents.laws.base import Law
from agents.loading import capabilities
from agents.swarm import SwarmBrief
from agents.wants import Wants
from analysis.models.finding import Finding
from netem.faults.fault import Fault, Verb
from netem.loading.choice import Choice


def chosen(given: Scenario) -> tuple[Choice, Choice]:
    """Estimator and law.

    Raises
    ------
    ScenarioError
        When there is no such one, or the law steers other bodies.
    UserCodeError
        When they are a user's own, and are not what they should be.
    """
    estimator = _choice(given, registry.ESTIMATORS, "estimator", given.agents.estimator)
    law = _choice(given, registry.LAWS, "law", given.agents.law)
    _check_order(given, law.build())
    return estimator, law


def findings(estimator: Any, law: Law[Any], swarm: SwarmBrief) -> list[Finding]:
    """What law and estimator find of a swarm, and whether the followers settle.

    Raises
    ------
    UserCodeError
        When they fail to say.
    """
    step = [checks.step(law, swarm)] if law.by_stress else []
    return [*capabilities.findings(law, swarm), *step, *capabilities.findings(estimator, swarm)]


def refuse_late(given: Scenario, name: str, wants: Wants) -> None:
    """Refuse messages that are all late where an algorithm of this name wants synchronous exchange.

    Raises
    ------
    ScenarioError
        Naming the key.
    """
    wanted = f"{name} wants to hear in a tick what is said in it"
    if wants.synchronous and given.time.exchange == "next-tick":
        raise ScenarioError(f"time.exchange: {wanted}; set it to 'same-tick'")
    if wants.synchronous and given.network.delay_ticks:
        raise ScenarioError(f"network.delay_ticks: {wanted}; set it to 0")


def refuse_absent(faults: Sequence[Fault], name: str, wants: Wants, centre: CheckedCentre | None) -> None:
    """Refuse that agents are killed or paused where an algorithm of this name, or a centre, wants everybody.

    Parameters
    ----------
    faults
        What is scripted.
    name, wants
        The algorithm, and what it wants.
    centre
        The filter that hears everybody, if there is one.

    Raises
    ------
    ScenarioError
        Naming who it is.
    """
    if not any(fault.verb in (Verb.KILL, Verb.PAUSE) for fault in faults):
        return
    if centre is not None:
        raise ScenarioError(
            "timeline: the centralized filter waits for every agent in every tick; nobody can be killed or paused"
        )
    if wants.everybody:
        raise ScenarioError(f"timeline: {name} wants everybody there in every tick; nobody can be killed or paused")


def _choice(given: Scenario, group: str, key: str, name: str) -> Choice:
    parameters = given.agents.parameters.get(name, {})
    return registry.choose(group, f"agents.{key}", name, parameters, given.own_modules)


def _check_order(given: Scenario, law: Law[Any]) -> None:
    orders = "1 if it steers velocities, 2 if accelerations, 3 if jerks, 4 if snaps"
    registry.refuse_other(law, "order", lambda said: type(said) is int and 1 <= said <= 4, orders)
    registry.refuse_other(law, "by_stress", lambda said: type(said) is bool, "whether it weighs edges by the stress")
    if given.agents.leaders == "distances" and law.order != 1:
        raise ScenarioError("agents.leaders: 'distances' is held by velocities; double integrators have 'pilot'")
    if given.formation.leaders and law.order > 2:
        raise ScenarioError("formation.leaders: who leads is steered by velocities or accelerations; give none")
    if law.order != given.dynamics.order:
        steers = ("velocities", "accelerations", "jerks", "snaps")[law.order - 1]
        fits = INTEGRATORS[law.order - 1]
        raise ScenarioError(
            f"dynamics.model: {given.agents.law} steers {steers}, and bodies are {given.dynamics.model}s; "
            f"set it to {fits!r}, or choose another law"
        )
