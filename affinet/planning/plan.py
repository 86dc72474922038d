"""A plan: all that a runtime needs to fly a scenario, every process's brief ready. Nothing has started yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

from affinet.scenario.loading import to_toml
from affinet.scenario.programs import words
from affinet.scenario.sections import Scenario
from affinet.scenario.words import one_line
from agents.agent import Agent
from agents.brief import Brief
from agents.centre.checked import CheckedCentre, centre_of
from agents.loading import capabilities
from agents.swarm import SwarmBrief
from agents.timer import Timer
from agents.wants import Wants
from analysis.models.arrays import Mask
from analysis.models.finding import Finding
from analysis.models.information import reported
from netem.core.channels import PLACE
from netem.core.pace import Pace
from netem.core.refusal import Refusal
from netem.faults.fault import Fault
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger
from netem.impairments.profile import Profile
from netem.loading.choice import Choice
from netem.medium.medium import Verdicted, recorded
from world.books.scenery import JammedBall, Scenery
from world.brief import RecordOptions
from world.formation import manoeuvre
from world.physics.world import World

_MOST_OF_A_BATCH = 50
_BATCH_S, _BATCH_IN_REAL_TIME_S = 1.0, 0.25


class PlanError(Refusal, ValueError):
    """The scenario is well formed, but cannot fly: why, in plain words."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        super().__init__(self.findings)

    def __str__(self) -> str:
        wrong = (f"{finding.check}: {finding.says}" for finding in self.findings if finding.fatal)
        return "; ".join(map(one_line, wrong))


@dataclass(frozen=True, eq=False)
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
    swarm
        What is known of all of them together; of one swarm, however many fly side by side.
    reports
        What the estimator reports beyond edges, by name, and the shape of each for one agent.
    findings
        What was checked.
    timers
        When each agent wakes, in a run in real time; none in lockstep.
    pace
        How time goes in a run in real time; None in lockstep.
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
    swarm: SwarmBrief
    reports: Mapping[str, tuple[int, ...]]
    findings: tuple[Finding, ...]
    timers: tuple[Timer, ...] = ()
    pace: Pace | None = None
    journal: Path | None = None
    injected: tuple[Fault, ...] = ()

    def __getstate__(self) -> dict[str, object]:
        """What it was made of: what it has worked out since can be worked out again, wherever it is taken."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def facing(self, injected: Sequence[Fault]) -> Plan:
        """The plan with faults that an earlier run was given while it flew."""
        return replace(self, injected=tuple(injected))

    def recorded(self) -> Verdicted | None:
        """The verdicts of the earlier run that is to be judge of this one."""
        return recorded(self.journal, self.world.links, self.channels)

    def books(self, viewer: str | None) -> RecordOptions:
        """How a run of it is written down, and streamed to a viewer that listens at this URL."""
        record = self.scenario.record
        settings = f"```toml\n{to_toml(self.scenario)}```\n"
        return RecordOptions(record.every, self.batch, self.window, record.enabled, viewer, settings, self.scenery)

    @property
    def batch(self) -> int:
        """Ticks that are written down at once."""
        # Who is killed has lost a batch, and in real time what a thread was still to write, or another machine to give.
        seconds = _BATCH_S if self.pace is None else _BATCH_IN_REAL_TIME_S * min(1.0, self.pace.factor)
        return min(_MOST_OF_A_BATCH, max(1, int(seconds / self.world.dt)))

    @property
    def scenery(self) -> Scenery:
        """What the swarm flies through, as far as it is known before."""
        own, flown = self.profiles[0], self.scenario.manoeuvre
        walls = flown.walls or manoeuvre.WALLS.get(flown.preset or "", ())
        return Scenery(
            tuple(tuple(map(tuple, wall)) for wall in walls),
            tuple(JammedBall(tuple(zone.centre.tolist()), zone.radius, zone.share) for zone in own.zones),
            max((reach.outer for reach in own.reaches if reach.comms), default=None),
        )

    @property
    def window(self) -> int:
        """Ticks over which links count as working together in the realised graph."""
        return max(1, round(self.scenario.record.window / self.world.dt))

    @cached_property
    def timeline(self) -> Timeline:
        """All faults over the links."""
        return Timeline(self.world.links, self.faults, self.triggers, self.injected)

    @cached_property
    def programs(self) -> Mapping[int, Sequence[str]]:
        """Command lines of the programs that fly some agents in place of ours, by number of the agent."""
        return {int(number): words(command) for number, command in self.scenario.agents.programs.items()}

    @cached_property
    def wants(self) -> Wants:
        """What estimator and law want, together."""
        of_both = (capabilities.wants(algorithm.build()) for algorithm in (self.estimator, self.law))
        return Wants(*map(any, zip(*of_both, strict=True)))

    @cached_property
    def positioned(self) -> Mask:
        """Which agents are told where they are, shape (N,): leaders, and all where estimator or law want it."""
        return (self.world.formation.is_leader | self.wants.position) & self.knows_positions

    @property
    def localizes(self) -> bool:
        """Whether agents find out where they are."""
        return PLACE in self.reports

    @property
    def pursues(self) -> bool:
        """Whether agents find a target, and fly after it."""
        return self.world.pursuit is not None and reported(self.reports)

    @property
    def may_have_gaps(self) -> bool:
        """Whether sensors may say nothing, and it may not be known where agents are: where physics is not simulated."""
        return self.scenario.world != "simulated"

    @property
    def located(self) -> Mask:
        """Agents of whom it has to be known where they are, shape (N,): also for who is lost by distance, and what waits."""
        by_place = any(profile.spatial for profile in self.profiles) or bool(self.triggers)
        return self.positioned | by_place

    @property
    def knows_positions(self) -> bool:
        """Whether somebody may be told where he is: all but in a recorded flight without a reference."""
        return self.world.flight is None or self.world.flight.has_reference

    @cached_property
    def told_mission(self) -> Mask:
        """Which agents know the manoeuvre, and fly it by their clocks, shape (N,)."""
        piloted = self.world.formation.is_leader & (self.scenario.agents.leaders == "pilot")
        return piloted | self.wants.mission

    @cached_property
    def centre(self) -> CheckedCentre | None:
        """The filter that hears everybody, where the estimator wants one; of one swarm, however many fly side by side."""
        return centre_of(self.estimator.build(), self.swarm)

    @property
    def agents(self) -> Agent:
        """All agents, as one batch."""
        return agents_of(self.scenario, self.brief, self.estimator, self.law, self.reports)

    def brief_of(self, row: int) -> Brief:
        """All that one agent is told, in a process of its own."""
        told = bool(self.told_mission[row])
        return replace(self.brief.of(row), mission=self.brief.mission if told else None)

    def alone(self, row: int) -> Agent:
        """One of the agents, as it flies in a process of its own."""
        return agents_of(self.scenario, self.brief_of(row), self.estimator, self.law, self.reports)


def agents_of(
    given: Scenario, brief: Brief, estimator: Choice, law: Choice, reports: Mapping[str, tuple[int, ...]] | None
) -> Agent:
    """The agents of a scenario, as one batch or one alone, as their brief is; `reports` as far as they are known."""
    flown = given.agents
    return Agent(brief, estimator.build(), law.build(), flown.leaders, flown.leader_gain, flown.limit, reports)
