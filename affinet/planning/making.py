"""Scenario -> plan: the stress solved, everything checked. Nothing is started."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from affinet.planning import (
    algorithms,
    checks,
    flight_logs,
    lateness,
    limits,
    network,
    outside,
    own_losses,
    phases,
    recordings,
    registry,
    script,
    timers,
    tryout,
)
from affinet.planning.blueprint import brief_of, formation_of, keyframes_of, swarm_of, world_of
from affinet.planning.plan import Plan, PlanError, agents_of
from affinet.planning.programs import refuse_strangers
from affinet.scenario import inputs, loading
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from agents.centre.checked import centre_of
from agents.laws.base import Law
from agents.loading import capabilities
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.unsuited import Unsuited
from netem.core import channels
from netem.core.links import Links
from netem.faults.fault import Fault, Verb
from netem.medium.medium import JOURNAL
from world.formation import stress
from world.formation.nominal import Formation, NotRigid


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
    from netem.medium import journal, recorded  # pyarrow takes a while to import, and only a replay reads journals

    file, judge = (out / JOURNAL).resolve(), inputs.kept(out).verdicts
    given = loading.resolved(out, overrides, folder)
    if verdicts:
        judged_by: Path | None = file
    else:
        judged_by = None if judge is None else (out / inputs.FOLDER / judge).resolve()
    if judged_by is not None:
        recordings.refuse_to_judge(loading.resolved(out), given)
    try:
        plan = make(given, injected=journal.told(file).injected, journal=judged_by)
        if judged_by is not None:
            recorded.check(journal.read(judged_by), plan.channels, plan.world.ticks)
    except journal.JournalError as error:
        raise ScenarioError(f"{out}: {error}") from error
    return replace(plan, findings=(*plan.findings, *inputs.changed(out)))


def _make(given: Scenario) -> Plan:
    registry.check_parameters(given.agents.parameters, given.own_modules)
    own_losses.check(given.network.profiles, given.own_modules)
    formation = formation_of(given)
    estimator, law = algorithms.chosen(given)
    findings, L = _framework(given, formation, law.build())
    first = world_of(limits.first_tick(given), formation)
    refuse_strangers(given.agents.programs, first.links.agents)
    memory = psutil.virtual_memory().total
    fits = limits.swarm(formation, first.links, memory)
    _refuse_fatal([*findings, fits])
    played = script.write(given, formation, first.links)
    swarm = swarm_of(given, first, L, lateness.of(given, formation, first.links, played))
    with registry.refusing("agents", Unsuited):
        findings += algorithms.findings(estimator.build(), law.build(), swarm)
        centre = centre_of(estimator.build(), swarm)
    _refuse_fatal(findings)
    if centre is not None and given.time.mode == "real":
        raise ScenarioError(
            f"time.mode: the centralized filter of {given.agents.estimator} waits for everybody in every tick; "
            "fly it in 'lockstep'"
        )
    brief = brief_of(first, L, swarm.lateness)
    for name, algorithm in ((given.agents.estimator, estimator), (given.agents.law, law)):
        wants = capabilities.wants(algorithm.build())
        algorithms.refuse_late(given, name, wants)
        algorithms.refuse_absent(played.faults, name, wants, centre)
    agents = agents_of(given, brief, estimator, law, None)
    with registry.refusing("agents", Unsuited):
        reports = tryout.silent_tick(agents, centre)
    spoken = agents.channels()
    names = (channels.SENSE, *sorted([channels.MEASUREMENT, *spoken]))
    findings.append(limits.run(first, given.time, memory))
    _refuse_fatal(findings)
    world = world_of(given, formation)
    outside.refuse(given, played.faults)
    world = replace(world, flight=flight_logs.of(given, world))
    bits = network.message_bits(names, spoken, world.links, brief.dimension)
    _refuse_fatal(limits.messages(bits, world, reports, given.trust))
    own, aired = network.plan(given, formation, world.links, bits)
    degraded = [
        network.degraded(given, formation, world.links, bits, *named, _ruled(played.faults, number, world.links))
        for number, named in enumerate(played.profiles, start=1)
    ]
    profiles = (own, *(profile for profile, _ in degraded))
    outside.refuse_unknown_places(world, profiles, played.triggers)
    findings += outside.gaps(world)
    found = [*findings, *aired, *(note for _, said in degraded for note in said)]
    found += checks.timeline(played.faults, given.time.ticks, given.time.dt)
    found += [] if given.target is None else checks.detections(given.target, given.time.ticks * given.time.dt)
    if law.build().by_stress:
        found += phases.of_timeline(swarm, world.links, played.faults)
    plan = Plan(
        scenario=given,
        world=world,
        profiles=profiles,
        faults=played.faults,
        triggers=played.triggers,
        channels=names,
        brief=replace(brief, mission=world.manoeuvre),
        estimator=estimator,
        law=law,
        swarm=swarm,
        reports=reports,
        findings=tuple(dict.fromkeys(found)),  # both classes of channels may have the same to say
        timers=timers.of(given, formation),
        pace=timers.pace(given),
    )
    with registry.refusing("agents", Unsuited):
        tryout.alone(plan.alone, plan.positioned, plan.told_mission, centre)
    return plan


def _ruled(faults: Sequence[Fault], number: int, links: Links) -> Mask:
    """Links that a fault ever gives the profile of this number."""
    ruled = np.zeros(len(links), dtype=bool)
    degrading = [fault for fault in faults if fault.verb is Verb.DEGRADE and fault.profile == number]
    ruled[[links.index[pair] for fault in degrading for pair in fault.pairs]] = True
    return ruled


def _framework(given: Scenario, formation: Formation, law: Law[Any]) -> tuple[list[Finding], Array]:
    """What was found of a framework that can fly, and its stress matrix; zero for a law that needs none."""
    findings, flown = checks.graph(formation), given.agents
    if law.by_stress:
        findings.append(checks.leaders(formation))
    if flown.leaders == "distances":
        findings.append(checks.leaders_apart(formation))
    findings += checks.led(formation, flown.leaders, law.order, flown.leader_gain, given.time.dt)
    if given.manoeuvre.keyframes:
        times, theta, _, angle = keyframes_of(given, formation.dimension)
        findings += checks.maneuver(times, theta, angle)
    _refuse_fatal(findings)
    if not law.by_stress:
        return findings, np.zeros((formation.agents, formation.agents))
    if formation.weights is not None:
        L = stress.own(formation, formation.weights)
        return [*findings, *checks.own_weights(formation, L)], L
    try:
        L = stress.laplacian(formation, stress.solve(formation))
    except NotRigid as error:
        raise PlanError([checks.not_rigid(str(error))]) from error
    return [*findings, *checks.rigid(formation, L)], L


def _refuse_fatal(findings: Sequence[Finding]) -> None:
    if any(finding.fatal for finding in findings):
        raise PlanError(findings)
