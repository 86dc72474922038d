"""Scenario -> plan: the stress solved, everything checked, every process's brief ready. Nothing has started yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from affinet import checks, registry, sections
from affinet.checks import Finding
from affinet.sections import Scenario, ScenarioError
from agents.agent import Agent
from agents.brief import Brief
from agents.process import Choice
from analysis.affine import Array, Manoeuvre
from netem import channels
from netem.links import Links
from netem.profile import Profile
from netem.timeline import Fault, Timeline, Verb
from world import maneuver, stress
from world.formation import PRESETS, Formation
from world.world import World


class PlanError(ValueError):
    """The scenario is well formed, but cannot fly: why, in plain words."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        super().__init__("\n".join(f"{finding.check}: {finding.says}" for finding in findings if finding.fatal))
        self.findings = tuple(findings)


@dataclass(frozen=True)
class Plan:
    """All a runtime needs.

    Parameters
    ----------
    scenario
        As resolved.
    world, profile, faults, channels
        What the world and the medium are made of; channels with sensing first.
    brief, estimator, law
        What the agents are made of; the brief's arrays begin with the agents.
    findings
        What was checked.
    """

    scenario: Scenario
    world: World
    profile: Profile
    faults: tuple[Fault, ...]
    channels: tuple[str, ...]
    brief: Brief
    estimator: Choice
    law: Choice
    findings: tuple[Finding, ...]

    @property
    def timeline(self) -> Timeline:
        """The scripted faults over the links."""
        return Timeline(self.world.links, self.faults)

    @property
    def agents(self) -> Agent:
        """All agents, as one batch."""
        return Agent(self.brief, self.estimator.build(), self.law.build(), self.scenario.agents.leader_gain)


def make(given: Scenario) -> Plan:
    """The plan of a scenario.

    Raises
    ------
    ScenarioError
        When something in it names what does not exist.
    PlanError
        When it cannot fly.
    """
    try:
        return _make(given)
    except ScenarioError as error:
        raise given.locate(error) from error


def _make(given: Scenario) -> Plan:
    registry.check_names("agents.parameters", given.agents.parameters)
    formation = _formation(given)
    estimator = _choice(given, registry.ESTIMATORS, "estimator", given.agents.estimator)
    law = _choice(given, registry.LAWS, "law", given.agents.law)
    findings = checks.framework(formation)
    if any(finding.fatal for finding in findings):
        raise PlanError(findings)
    try:
        weights = stress.solve(formation)
    except stress.NotRigid as error:
        raise PlanError([checks.not_rigid(str(error))]) from error
    L = stress.laplacian(formation, weights)
    findings += checks.closed_loop(formation, L, law.build(), estimator.build(), given.time.dt)
    if any(finding.fatal for finding in findings):
        raise PlanError(findings)
    world = _world(given, formation)
    brief = _brief(world, L)
    faults = _faults(given, world.links)
    batch = Agent(brief, estimator.build(), law.build(), given.agents.leader_gain)
    spoken = sorted(map(channels.check, [channels.MEASUREMENT, *batch.channels()]))
    return Plan(
        scenario=given,
        world=world,
        profile=_profile(given, world.links),
        faults=faults,
        channels=(channels.SENSE, *spoken),
        brief=brief,
        estimator=estimator,
        law=law,
        findings=tuple(findings) + tuple(checks.timeline(faults, given.time.ticks, given.time.dt)),
    )


def _choice(given: Scenario, group: str, key: str, name: str) -> Choice:
    return registry.choose(group, f"agents.{key}", name, given.agents.parameters.get(name, {}))


def _formation(given: Scenario) -> Formation:
    section = given.formation
    if section.preset:
        preset = PRESETS[section.preset]
        nodes, edges, leaders = preset.nominal, preset.edges, preset.leaders
    else:
        nodes = np.array(section.nodes, dtype=np.float64)
        edges = tuple(sections.directed(edge)[0] for edge in section.edges or [])
        leaders = ()
    leaders = leaders if section.leaders is None else tuple(section.leaders)
    for key, numbers in (("leaders", leaders), ("edges", [agent for edge in edges for agent in edge])):
        if strangers := sorted({agent for agent in numbers if not 1 <= agent <= len(nodes)}):
            raise ScenarioError(f"formation.{key}: no agents {strangers}; agents are 1 to {len(nodes)}")
    return Formation(section.scale * nodes, edges, leaders)


def _world(given: Scenario, formation: Formation) -> World:
    return World(
        seed=given.seed,
        dt=given.time.dt,
        ticks=given.time.ticks,
        formation=formation,
        links=Links.both_ways(formation.agents, formation.edges),
        manoeuvre=_manoeuvre(given, formation.dimension),
        covariance=sections.covariance(given.sensing, formation.dimension),
        disturbance=given.dynamics.disturbance,
        spread=given.formation.spread,
    )


def _manoeuvre(given: Scenario, dimension: int) -> Manoeuvre:
    seconds: Array = np.arange(given.time.ticks + 1, dtype=np.float64) * given.time.dt
    section = given.manoeuvre
    if section.preset == "hover":
        return maneuver.hover(seconds, dimension)
    if section.preset == "corridor":
        if dimension != 2:
            raise ScenarioError("manoeuvre.preset: 'corridor' is flown in two dimensions; give keyframes")
        return maneuver.corridor(seconds)
    square = (dimension, dimension)
    theta, offset = [], []
    for number, frame in enumerate(section.keyframes, start=1):
        key = f"manoeuvre.keyframes.{number}"
        theta.append(sections.array(f"{key}.theta", frame.theta, square))
        offset.append(sections.array(f"{key}.offset", frame.offset, (dimension,)))
    return maneuver.keyframes(seconds, [frame.time for frame in section.keyframes], np.array(theta), np.array(offset))


def _brief(world: World, L: Array) -> Brief:
    formation, links = world.formation, world.links
    relative = formation.nominal[:, None] - formation.nominal[links.neighbours]
    weights = -np.take_along_axis(L, links.neighbours, axis=1)
    return Brief(
        dt=world.dt,
        nominal=formation.nominal,
        relative=np.where(links.present[..., None], relative, 0.0),
        present=links.present,
        stress=np.where(links.present, weights, 0.0),
        covariance=world.covariance,
        leader=formation.is_leader,
        mission=world.manoeuvre,
    )


def _profile(given: Scenario, links: Links) -> Profile:
    availability = np.full(len(links), given.network.availability)
    delay_ticks = np.full(len(links), given.network.delay_ticks)
    for number, special in enumerate(given.network.links, start=1):
        for pair in sections.directed(special.link):
            row = _row(links, pair, f"network.links.{number}.link")
            if special.availability is not None:
                availability[row] = special.availability
            if special.delay_ticks is not None:
                delay_ticks[row] = special.delay_ticks
    least = 1 if given.time.exchange == "next-tick" else 0
    return Profile(availability, delay_ticks, given.network.coupled, least)


def _row(links: Links, pair: tuple[int, int], key: str) -> int:
    if pair not in links.index:
        raise ScenarioError(f"{key}: {pair[0]}->{pair[1]} is not a link of the formation")
    return links.index[pair]


def _faults(given: Scenario, links: Links) -> tuple[Fault, ...]:
    faults: list[Fault] = []
    for number, event in enumerate(given.timeline, start=1):
        key = f"timeline.{number}"
        start = _tick(event.at, given.time.dt)
        if isinstance(event, sections.Restart):
            _restart(faults, event.agents, start, key)
            continue
        until = None if isinstance(event, sections.Kill) or event.until is None else _tick(event.until, given.time.dt)
        if isinstance(event, sections.Cut):
            pairs = tuple(pair for link in event.links for pair in sections.directed(link))
            for pair in pairs:
                _row(links, pair, f"{key}.links")
            faults.append(Fault(Verb.CUT, start, until, pairs=pairs))
        elif isinstance(event, sections.Partition):
            faults.append(Fault(Verb.PARTITION, start, until, groups=tuple(map(tuple, event.groups))))
        else:
            verb = Verb.KILL if isinstance(event, sections.Kill) else Verb.DEPART
            faults += [Fault(verb, start, until, agents=(agent,)) for agent in event.agents]
        _exists(links, number, faults)
    return tuple(faults)


def _exists(links: Links, number: int, faults: Sequence[Fault]) -> None:
    try:
        Timeline(links, faults)
    except ValueError as error:
        raise ScenarioError(f"timeline.{number}: {error}") from error


def _restart(faults: list[Fault], agents: Sequence[int], tick: int, key: str) -> None:
    for agent in agents:
        killed = [n for n, f in enumerate(faults) if f.verb is Verb.KILL and f.agents == (agent,) and f.end is None]
        if not any(faults[n].start < tick for n in killed):
            raise ScenarioError(f"{key}: agent {agent} is not dead then; name its kill before its restart")
        for n in killed:
            faults[n] = replace(faults[n], end=tick)


def _tick(seconds: float, dt: float) -> int:
    return round(seconds / dt)
