"""Scenario -> plan: the stress solved, everything checked, every process's brief ready. Nothing has started yet."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from affinet.planning import checks, limits, network, own_losses, recordings, registry, script, tryout
from affinet.planning.blueprint import brief_of, formation_of, keyframes_of, world_of
from affinet.scenario import inputs, loading, sections
from affinet.scenario.finding import Finding
from affinet.scenario.sections import Scenario, ScenarioError
from agents.agent import Agent
from agents.brief import Brief
from agents.centre.filter import Centre
from agents.estimators.centralized import CentralizedFilter
from agents.estimators.jor import JacobiOverRelaxation
from agents.laws.base import Law
from agents.laws.single import needs_mission
from analysis.models.arrays import Array, Mask
from analysis.models.information import reported
from analysis.models.unsuited import Unsuited
from netem.core import channels
from netem.core.links import Links
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger
from netem.impairments.profile import Profile
from netem.loading.calling import Calling, name_of
from netem.loading.choice import Choice
from netem.medium.medium import Verdicted, recorded
from netem.processes.user_code import UserCodeError, definition
from world.brief import RecordOptions
from world.formation import stress
from world.formation.nominal import Formation
from world.physics.world import World


class PlanError(ValueError):
    """The scenario is well formed, but cannot fly: why, in plain words."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        super().__init__("; ".join(f"{finding.check}: {finding.says}" for finding in findings if finding.fatal))
        self.findings = tuple(findings)


@dataclass(frozen=True)
class Plan:
    """All a runtime needs.

    Parameters
    ----------
    scenario
        As resolved.
    world, profiles, faults, triggers, channels
        What the world and the medium are made of; profiles with the links' own first, channels with sensing first.
    brief, estimator, law
        What the agents are made of; the brief's arrays begin with the agents.
    reports
        What the estimator reports beyond edges, by name, and the shape of each for one agent.
    findings
        What was checked.
    journal
        That of an earlier run, when its verdicts are to be this run's.
    injected
        Faults that the scenario does not script: an earlier run was given them while it flew.
    """

    scenario: Scenario
    world: World
    profiles: tuple[Profile, ...]
    faults: tuple[Fault, ...]
    triggers: tuple[Trigger, ...]
    channels: tuple[str, ...]
    brief: Brief
    estimator: Choice
    law: Choice
    reports: Mapping[str, tuple[int, ...]]
    findings: tuple[Finding, ...]
    journal: Path | None = None
    injected: tuple[Fault, ...] = ()

    def facing(self, injected: Sequence[Fault]) -> Plan:
        """The plan with faults that an earlier run was given while it flew."""
        return replace(self, injected=tuple(injected))

    def recorded(self) -> Verdicted | None:
        """The verdicts of the earlier run that is to be judge of this one."""
        return recorded(self.journal, self.world.links, self.channels)

    def books(self, viewer: str | None) -> RecordOptions:
        """How a run of it is written down, and streamed to a viewer that listens at this URL."""
        record = self.scenario.record
        pursues = self.world.pursuit is not None and reported(self.reports)
        return RecordOptions(record.every, self.window, record.enabled, viewer, channels.PLACE in self.reports, pursues)

    @property
    def window(self) -> int:
        """Ticks over which links count as working together in the realised graph."""
        return max(1, _tick(self.scenario.record.window, self.world.dt))

    @cached_property
    def timeline(self) -> Timeline:
        """All faults over the links."""
        return Timeline(self.world.links, (*self.faults, *self.injected), self.triggers)

    @cached_property
    def positioned(self) -> Mask:
        """Which agents are told where they are, shape (N,): leaders, and all whose law steers by it."""
        return self.world.formation.is_leader | self.law.build().by_position

    @cached_property
    def told_mission(self) -> Mask:
        """Which agents know the manoeuvre, and fly it by their clocks, shape (N,)."""
        piloted = self.world.formation.is_leader & (self.scenario.agents.leaders == "pilot")
        return piloted | needs_mission(self.law.build())

    @cached_property
    def centre(self) -> Centre | None:
        """The filter that hears everybody, where the estimator wants one; of one swarm, however many fly side by side."""
        estimator, world = self.estimator.build(), self.world
        if not isinstance(estimator, CentralizedFilter):
            return None
        size, links = world.formation.agents // world.swarms, world.links
        Q_A = world.disturbance.between(world.formation.nominal[:size])
        return Centre(
            dt=world.dt,
            neighbours=links.neighbours[:size],
            present=links.present[:size],
            sensor=world.sensor,
            process=np.asarray(np.kron(Q_A, world.disturbance.covariance), dtype=np.float64),
            prior_position=estimator.prior_position,
        )

    @property
    def agents(self) -> Agent:
        """All agents, as one batch."""
        return _agents(self.scenario, self.brief, self.estimator, self.law, self.reports)

    def brief_of(self, row: int) -> Brief:
        """All that one agent is told, in a process of its own."""
        told = bool(self.told_mission[row])
        return replace(self.brief.of(row), mission=self.brief.mission if told else None)

    def alone(self, row: int) -> Agent:
        """One of the agents, as it flies in a process of its own."""
        return _agents(self.scenario, self.brief_of(row), self.estimator, self.law, self.reports)


def make(given: Scenario, *, injected: Sequence[Fault] = (), journal: Path | None = None) -> Plan:
    """The plan of a scenario.

    Parameters
    ----------
    given
        The scenario.
    injected
        Faults that an earlier run was given while it flew.
    journal
        That of an earlier run, whose verdicts are to be this run's.

    Raises
    ------
    ScenarioError
        When something in it names what does not exist.
    PlanError
        When it cannot fly.
    UserCodeError
        When the user's own estimator or law does something wrong.
    """
    try:
        with redirect_stdout(sys.stderr):  # what estimators and laws print is not between what the command says
            return replace(_make(given), journal=journal).facing(injected)
    except ScenarioError as error:
        raise given.locate(error) from error


def again(out: Path, overrides: Sequence[str], *, verdicts: bool, folder: Path | None = None) -> Plan:
    """The plan of a run directory, with the faults that were injected while it flew.

    Parameters
    ----------
    out
        The run directory.
    overrides, folder
        Changes to its scenario, and what paths in them are relative to, by default the run directory.
    verdicts
        Whether its journal is to be judge, in place of the models. Where an earlier one was, that one is anyway.

    Raises
    ------
    ScenarioError
        When it holds no run, or no journal, or its verdicts are of other ticks or links.
    """
    from netem.medium import journal  # pyarrow takes a while to import, and only a replay reads journals

    file, judge = (out / journal.FILE).resolve(), inputs.kept(out).verdicts
    given = loading.resolved(out, overrides, folder)
    if verdicts:
        judged_by: Path | None = file
    else:
        judged_by = None if judge is None else (out / inputs.FOLDER / judge).resolve()
    if judged_by is not None:
        recordings.refuse_to_judge(loading.resolved(out), given)
    try:
        plan = make(given, injected=journal.injected(journal.read(file)), journal=judged_by)
        if judged_by is not None:
            journal.check(journal.read(judged_by), plan.channels, plan.world.ticks)
    except journal.JournalError as error:
        raise ScenarioError(f"{out}: {error}") from error
    return replace(plan, findings=(*plan.findings, *inputs.changed(out)))


def _make(given: Scenario) -> Plan:
    registry.check_parameters(given.agents.parameters, given.own_modules)
    own_losses.check(given.network.profiles, given.own_modules)
    formation = formation_of(given)
    estimator = _choice(given, registry.ESTIMATORS, "estimator", given.agents.estimator)
    law = _choice(given, registry.LAWS, "law", given.agents.law)
    _check_order(given, law.build())
    findings, L = _framework(given, formation, law.build(), estimator.build())
    first = world_of(limits.first_tick(given), formation)
    if isinstance(built := estimator.build(), JacobiOverRelaxation):
        findings.append(checks.localization_step(first, built))
        _refuse_fatal(findings)
    memory = psutil.virtual_memory().total
    findings.append(limits.swarm(formation, first.links, memory))
    _refuse_fatal(findings)
    brief = brief_of(first, L)
    played = script.write(given, formation, first.links)
    if isinstance(estimator.build(), CentralizedFilter):
        _refuse_absences(played.faults)
    agents = _agents(given, brief, estimator, law, None)
    with registry.refusing("agents", Unsuited):
        reports = tryout.silent_tick(agents)
    spoken = agents.channels()
    names = (channels.SENSE, *sorted([channels.MEASUREMENT, *spoken]))
    findings.append(limits.run(first, len(names), reports, given.time, memory))
    _refuse_fatal(findings)
    world = world_of(given, formation)
    bits = network.message_bits(names, spoken, world.links, brief.dimension)
    own, aired = network.plan(given, formation, world.links, bits)
    degraded = [
        network.degraded(given, formation, world.links, bits, *named, _ruled(played.faults, number, world.links))
        for number, named in enumerate(played.profiles, start=1)
    ]
    found = [*findings, *aired, *(note for _, said in degraded for note in said)]
    found += checks.timeline(played.faults, given.time.ticks, given.time.dt)
    plan = Plan(
        scenario=given,
        world=world,
        profiles=(own, *(profile for profile, _ in degraded)),
        faults=played.faults,
        triggers=played.triggers,
        channels=names,
        brief=replace(brief, mission=world.manoeuvre),
        estimator=estimator,
        law=law,
        reports=reports,
        findings=tuple(dict.fromkeys(found)),  # both classes of channels may have the same to say
    )
    with registry.refusing("agents", Unsuited):
        tryout.alone(plan.alone, plan.positioned)
    return plan


def _ruled(faults: Sequence[Fault], number: int, links: Links) -> Mask:
    """Links that a fault ever gives the profile of this number."""
    ruled = np.zeros(len(links), dtype=bool)
    degrading = [fault for fault in faults if fault.verb is Verb.DEGRADE and fault.profile == number]
    ruled[[links.index[pair] for fault in degrading for pair in fault.pairs]] = True
    return ruled


def _framework(given: Scenario, formation: Formation, law: Law[Any], estimator: Any) -> tuple[list[Finding], Array]:
    """What was found of a framework that can fly, and its stress matrix; zero for a law that needs none."""
    findings = checks.graph(formation)
    if law.by_stress:
        findings.append(checks.leaders(formation))
    if given.agents.leaders == "distances":
        findings.append(checks.leaders_apart(formation))
    late = given.time.exchange == "next-tick" or given.network.delay_ticks > 0
    flown, dt = given.agents, given.time.dt
    findings += [*checks.in_time(estimator, late), *checks.chatter(estimator, dt), *checks.forgetting(estimator, dt)]
    findings += [*checks.led(formation, flown.leaders, law.order, flown.leader_gain, dt), *checks.pursued(law, dt)]
    findings += checks.averaging(estimator, given.time.ticks)
    if given.manoeuvre.keyframes:
        times, theta, _, angle = keyframes_of(given, formation.dimension)
        findings += checks.maneuver(times, theta, angle)
    _refuse_fatal(findings)
    if not law.by_stress:
        return findings, np.zeros((formation.agents, formation.agents))
    try:
        L = stress.laplacian(formation, stress.solve(formation))
    except stress.NotRigid as error:
        raise PlanError([checks.not_rigid(str(error))]) from error
    findings += checks.closed_loop(formation, L, law, estimator, given.time.dt)
    _refuse_fatal(findings)
    return findings, L


def _refuse_fatal(findings: Sequence[Finding]) -> None:
    if any(finding.fatal for finding in findings):
        raise PlanError(findings)


def _choice(given: Scenario, group: str, key: str, name: str) -> Choice:
    parameters = given.agents.parameters.get(name, {})
    return registry.choose(group, f"agents.{key}", name, parameters, given.own_modules)


def _check_order(given: Scenario, law: Law[Any]) -> None:
    _check_says(law, "order", (1, 2, 3, 4), "1 if it steers velocities, 2 if accelerations, 3 if jerks, 4 if snaps")
    _check_says(law, "by_stress", (True, False), "whether it weighs edges by the stress")
    _check_says(law, "by_position", (True, False), "whether it needs the agent's position")
    if given.agents.leaders == "distances" and law.order != 1:
        raise ScenarioError("agents.leaders: 'distances' is held by velocities; double integrators have 'pilot'")
    if given.formation.leaders and law.order > 2:
        raise ScenarioError("formation.leaders: who leads is steered by velocities or accelerations; give none")
    if law.order != given.dynamics.order:
        steers = ("velocities", "accelerations", "jerks", "snaps")[law.order - 1]
        fits = sections.INTEGRATORS[law.order - 1]
        raise ScenarioError(
            f"dynamics.model: {given.agents.law} steers {steers}, and bodies are {given.dynamics.model}s; "
            f"set it to {fits!r}, or choose another law"
        )


def _check_says(law: Law[Any], name: str, values: tuple[int, ...], what: str) -> None:
    with Calling(law, name):
        said = getattr(law, name, None)
    if said not in values:
        has_none = f"has no {name!r}: {what}" if said is None else f"{name!r} is {said!r}: {what}"
        raise UserCodeError(name_of(type(law)), has_none, definition(type(law)))


def _agents(
    given: Scenario, brief: Brief, estimator: Choice, law: Choice, reports: Mapping[str, tuple[int, ...]] | None
) -> Agent:
    flown = given.agents
    return Agent(brief, estimator.build(), law.build(), flown.leaders, flown.leader_gain, flown.limit, reports)


def _refuse_absences(faults: Sequence[Fault]) -> None:
    if any(fault.verb in (Verb.KILL, Verb.PAUSE) for fault in faults):
        raise ScenarioError(
            "timeline: the centralized filter waits for every agent in every tick; nobody can be killed or paused"
        )


def _tick(seconds: float, dt: float) -> int:
    return round(seconds / dt)
