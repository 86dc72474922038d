"""Runtime 2: a swarm of processes over Zenoh, started, watched, killed and restarted from here."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from affinet.planning.plan import Plan
from affinet.runtimes.briefs import agent_brief
from affinet.runtimes.child import Child, RunFailed, UserCodeFailed
from affinet.runtimes.forked import NURSERY
from affinet.runtimes.inject import Access
from affinet.runtimes.interruption import Interrupted, Interruption
from affinet.runtimes.machines.seats import hosts_of
from affinet.runtimes.machines.spread import Spread
from affinet.runtimes.private import private_folder
from affinet.runtimes.supervision import ProcessGroup
from affinet.runtimes.told import Event
from affinet.scenario.programs import words
from affinet.verdicts.refused import in_words
from agents.arrivals import forms_of
from agents.centre.process import CentreBrief
from agents.node import HostBrief
from analysis.metrics.errors import tracking_error
from netem.brief import MediumBrief
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from netem.medium.medium import JOURNAL
from netem.processes.supervised import LOST
from netem.processes.system_errors import afterwards, said
from netem.wire import keys
from netem.wire.intake import Trust
from netem.wire.session import CENTRE, CONTROL, DRIVER, HUB, WORLD, Login, agent_name, clients, host_name, seat_name
from world.brief import DriverBrief, WorldBrief
from world.physics.world import World


@dataclass
class LaunchRecord:
    """What came of a run over processes.

    Parameters
    ----------
    uninstructed
        Messages lost that nobody ordered; None when the run did not get to its end.
    fired
        In which tick each trigger fired that did.
    lost
        Messages that the transport between machines lost, and that were had again.
    failure, user_code
        Why the run ended early, if it did, and whether a user's own code is why.
    start_s, wall_s
        From the first process started to the first tick, and from there to the end, in seconds.
    refused
        Messages that were refused: of which agent, by whom, for what mistake, and how many.
    processes
        Every process there was.
    """

    uninstructed: int | None = None
    fired: dict[int, int] = field(default_factory=dict)
    lost: int = 0
    failure: str | None = None
    user_code: bool = False
    start_s: float = 0.0
    wall_s: float = 0.0
    refused: list[dict[str, Any]] = field(default_factory=list)
    processes: list[dict[str, Any]] = field(default_factory=list)


class Launcher:
    """Flies one plan over processes."""

    def __init__(
        self,
        plan: Plan,
        out: Path,
        *,
        watch: Callable[[int, float], None],
        viewer: str | None = None,
        programs: Mapping[int, Sequence[str]] | None = None,
        interruption: Interruption | None = None,
        spread: Spread | None = None,
    ) -> None:
        """Nothing is started yet.

        Parameters
        ----------
        plan, out
            What to fly, and the run directory.
        watch
            Called with the tick and the tracking error now and then.
        viewer
            URL of a Rerun viewer that is listening.
        programs
            Command lines of programs that fly some agents in place of ours (docs/agents.md), on top of those of the plan.
        interruption
            What may ask the run to end.
        spread
            The other machines that fly some of it.
        """
        self._plan = plan
        self._out = out
        self._viewer = viewer
        self._watch = watch
        self._programs = {**plan.programs, **(programs or {})}
        self._interruption = interruption or Interruption()
        self._run = keys.fresh()
        self._logins: dict[str, Login] = {}
        self._agents: dict[int, Child] = {}  # that have a process to themselves
        self._hosts = hosts_of(plan, self._programs, () if spread is None else spread.groups)
        self._spread = spread
        self.flight = LaunchRecord()

    def fly(self) -> LaunchRecord:
        """Run to the end, to the first thing that goes wrong, or until the run is asked to end."""
        try:
            self._launch()
        except (RunFailed, Interrupted) as failure:
            self.flight.failure = "; ".join(filter(None, [str(failure), self._refusals()]))
            self.flight.user_code = isinstance(failure, UserCodeFailed)
        except OSError as error:
            self.flight.failure = f"the swarm could not be launched: {said(error)}"
        return self.flight

    def _refusals(self) -> str:
        """What was dropped, which may be why nothing moved any more."""
        return in_words(self.flight.refused) if self._plan.scenario.trust.wrong_messages == "drop" else ""

    def _launch(self) -> None:
        logs = self._out / "logs"
        logs.mkdir(parents=True, exist_ok=True)
        machines = None if self._spread is None else self._spread.coordinator
        group = ProcessGroup(logs, self._plan.scenario.time.patience, self._interruption, machines)
        launched = time.perf_counter()
        with (
            afterwards(partial(self._note, group), partial(_remove_unwritten, self._out)),
            private_folder() as self._private,
            self._spread or nullcontext(),
            group,
        ):
            self._start(group)
            with Access(self._run, self._logins[CONTROL]).granted(self._out, self._private):
                self._fly(group, launched)

    def _note(self, group: ProcessGroup) -> None:
        self.flight.lost = group.lost
        self.flight.processes = [report | self._clock(report["role"], report["id"]) for report in group.reports]
        self.flight.refused = [
            {"agent": agent, "by": child.name, "wrong": wrong, "count": count}
            for child in group.children
            for (agent, wrong), count in child.refused.items()
        ]

    def _clock(self, role: str, number: int | None) -> dict[str, float]:
        if self._spread is None or role == NURSERY:
            return {}
        return self._spread.report(seat_name(role, number))

    def _clock_s(self, name: str) -> float:
        """How much the medium's clock shows more than that of a process, in seconds."""
        return 0.0 if self._spread is None else self._spread.coordinator.clock(name).offset_s

    def _start(self, group: ProcessGroup) -> None:
        _prepare_kernels(self._plan.world)
        group.start_nursery(self._private)
        if self._spread is not None:
            self._spread.coordinator.await_everybody(self._interruption.heed)
        self._logins = self._make_logins(self._private)
        group.fork("world", self._world_brief(self._logins[WORLD]), trusted=True)
        medium = self._medium_brief(self._logins[HUB])
        own_losses = any(profile.own for profile in medium.profiles)
        group.fork("netem", medium, trusted=not own_losses)
        if self._plan.centre:
            login = self._logins[CENTRE]
            group.fork("centre", self._centre_brief(login))
        if (external := self._plan.scenario.external) is not None:
            group.start("driver", words(external.driver), self._driver_brief(self._logins[DRIVER]))
        for host, carried in self._hosts.items():
            group.fork("host", self._host_brief(host, carried), host, carrying=carried)
        for number in self._lone:
            self._start_agent(group, number)
        group.await_ready(group.children)

    def _make_logins(self, private: Path) -> dict[str, Login]:
        names = [HUB, *clients(self._numbers, self._hosts)]
        if self._spread is not None:
            return self._spread.logins(names)
        endpoint = f"unixsock-stream/{private}/z.sock"
        return {name: Login(endpoint, name, secrets.token_hex(16)) for name in names}

    def _fly(self, group: ProcessGroup, launched: float) -> None:
        world, medium = group.children[0], group.children[1]
        world.order("go")
        first_tick = time.perf_counter()
        self.flight.start_s = first_tick - launched
        while awaited := [child for child in (world, medium) if not child.is_done]:
            for child, event in group.listen():
                self._heed(group, child, event)
                self.flight.wall_s = time.perf_counter() - first_tick
            group.blame_the_silent(awaited)
        group.release()
        medium.order("leave")
        group.await_all_gone()

    def _heed(self, group: ProcessGroup, child: Child, event: Event) -> None:
        match event["event"]:
            case "tick":
                self._watch(event["k"], event["error"])
                group.children[event["k"] % len(group.children)].measure()
            case "kill" | "restart" | "pause" | "resume" as order:
                self._move(group, order, event)
                child.order(order)
            case "lost":
                group.children[1].order(f"{LOST} {event['key'].split('/', 2)[-1]} {event['count']}")
            case "fired":
                self.flight.fired |= dict.fromkeys(event["triggers"], event["k"])
            case "done" if child.role == WORLD:
                self.flight.uninstructed = event["uninstructed"]

    def _move(self, group: ProcessGroup, order: str, event: Event) -> None:
        # Of the agents in a host, that is told by the medium what becomes of each of them.
        moved = [number for number in event["agents"] if number in self._agents]
        match order:
            case "kill":
                for number in moved:
                    group.kill(self._agents[number])
            case "restart":
                remembering = event["remembering"]
                started = [self._start_agent(group, number, number in remembering) for number in moved]
                if self._plan.pace is None:  # in real time nobody waits for them
                    group.await_ready(started)
            case "pause":
                for number in moved:
                    self._agents[number].pause()
            case "resume":
                for number in moved:
                    self._agents[number].resume()

    @property
    def _lone(self) -> list[int]:
        """Agents that have a process to themselves."""
        carried = {number for of_host in self._hosts.values() for number in of_host}
        return [number for number in self._numbers if number not in carried]

    @property
    def _numbers(self) -> range:
        return range(1, self._plan.world.links.agents + 1)

    def _host_brief(self, host: int, carried: Sequence[int]) -> HostBrief:
        login, clock_s = self._logins[host_name(host)], self._clock_s(host_name(host))
        briefs = (agent_brief(self._plan, self._run, login, number, clock_s=clock_s) for number in carried)
        return HostBrief(host, tuple(briefs))

    def _start_agent(self, group: ProcessGroup, number: int, remembers: bool = False) -> Child:
        login = self._logins[agent_name(number)]
        warm = number in self._plan.timeline.warm
        checkpoint = str(self._folder(agent_name(number), self._private) / f"agent-{number}.npz") if warm else None
        brief = agent_brief(
            self._plan,
            self._run,
            login,
            number,
            checkpoint=checkpoint,
            remembers=remembers,
            clock_s=self._clock_s(agent_name(number)),
        )
        program = self._programs.get(number)
        child = group.start("agent", program, brief, number) if program else group.fork("agent", brief, number)
        self._agents[number] = child
        return child

    def _folder(self, name: str, here: Path) -> Path:
        """Where a process of this name writes."""
        return here if self._spread is None else self._spread.folder(name, here)

    @property
    def _trust(self) -> Trust:
        given = self._plan.scenario.trust
        return Trust(
            given.wrong_messages, given.largest_message, given.messages_per_tick, foreign=frozenset(self._programs)
        )

    def _world_brief(self, login: Login) -> WorldBrief:
        return WorldBrief(
            run=self._run,
            login=login,
            out=str(self._out),
            world=self._plan.world,
            channels=self._plan.channels,
            faults=self._plan.faults,
            triggers=self._plan.triggers,
            reports=self._plan.reports,
            limit=self._plan.scenario.agents.limit,
            trust=self._trust,
            is_outside=self._plan.scenario.external is not None,
            positioned=self._plan.located,
            books=self._plan.books(self._viewer),
            pace=self._plan.pace,
        )

    def _medium_brief(self, login: Login) -> MediumBrief:
        return MediumBrief(
            run=self._run,
            login=login,
            passwords={name: of.password for name, of in self._logins.items() if of.keys is None},
            seed=self._plan.scenario.seed,
            links=self._plan.world.links,
            channels=self._plan.channels,
            profiles=self._plan.profiles,
            faults=self._plan.faults,
            triggers=self._plan.triggers,
            injected=self._plan.injected,
            recorded=None if self._plan.journal is None else str(self._plan.journal),
            dimension=self._plan.world.formation.dimension,
            forms=forms_of(self._plan.agents.channels()),
            positioned=self._plan.positioned,
            hosts=self._hosts,
            trust=self._trust,
            journal=str(self._folder(HUB, self._out) / JOURNAL),
            batch=self._plan.batch,
            gaps=self._plan.may_have_gaps,
            pace=self._plan.pace,
            clock_s=self._clock_s(WORLD),
        )

    def _driver_brief(self, login: Login) -> DriverBrief:
        plan = self._plan
        return DriverBrief.of(self._run, login, plan.world, plan.located, plan.pace)

    def _centre_brief(self, login: Login) -> CentreBrief:
        return CentreBrief(self._run, login, self._plan.estimator, self._plan.swarm, self._trust)


def _prepare_kernels(world: World) -> None:
    """Call what the world calls: planning has called what agents do, and the nursery loads what was called."""
    first = world.begin()
    paused = Timeline(world.links, [Fault(Verb.PAUSE, 0, 1, agents=(1,))]).at(0)
    world.step(0, first, world.measure(0, first, paused), world.flown(0, first, first.velocity, paused), paused)
    tracking_error(first.position, world.goal(0, first), np.ones(len(first.position), dtype=bool))


def _remove_unwritten(out: Path) -> None:
    # A world that is killed before its first batch leaves tables without even a schema, which nothing can read.
    for table in out.glob("*.arrows"):
        if not table.stat().st_size:
            table.unlink()
