"""The tables of a scenario file as typed models: an unknown key, a wrong type or an impossible value is an error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from affinet.scenario.air import NetworkSection
from affinet.scenario.bodies import DynamicsSection, SensingSection
from affinet.scenario.keys import key
from affinet.scenario.outside import ExternalSection, RecordedSection
from affinet.scenario.programs import of_agents
from affinet.scenario.real_time import RealTimeSection
from affinet.scenario.section import Section
from affinet.scenario.selectors import edge
from affinet.scenario.source import IN_CODE, Source
from affinet.scenario.target import TargetSection
from affinet.scenario.units import (
    Finite,
    Matrix,
    NotNegative,
    Positive,
    Tick,
    refuse_unordered,
)
from affinet.scenario.verbs import AnyEvent
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError
from world.formation import swarms


def _edge(text: str) -> str:
    edge(text)
    return text


Edge = Annotated[str, AfterValidator(_edge)]


class GraphFields(Section):
    """What a file of a graph calls its fields."""

    x: str = key("x", "of a node: its first coordinate", "m")
    y: str = key("y", "its second", "m")
    z: str = key("z", "its third, in space", "m")
    leader: str = key("leader", "whether it leads: true or false, 1 or 0")


class FormationSection(Section):
    """Who flies: a preset, or a file, or nodes, edges and leaders. Positions in metres, agents numbered from 1.

    `weights` of one's own take the place of the stress that is solved for: of each edge i-j one number, or what i gives j and
    what j gives i.
    """

    preset: str | None = key(
        None, "a formation by name, in place of nodes, edges and leaders: " + ", ".join(swarms.NAMES)
    )
    file: str | None = key(None, "GraphML, or JSON as networkx writes it, in place of nodes, edges and leaders")
    fields: GraphFields | None = key(None, "what the file calls its fields, where that is not x, y, z and leader")
    nodes: Matrix | None = key(None, "nominal positions, two coordinates each, or three", "m")
    edges: list[Edge] | None = key(None, 'undirected, like "1-2"; wanted with nodes')
    leaders: list[int] | None = key(None, "agents that fly the manoeuvre; wanted with nodes, a preset has its own")
    weights: list[Finite] | Matrix | None = key(
        None,
        "in place of the stress that is solved for, in the order of the edges i-j: a number each, or two "
        "each, [what i gives j, what j gives i], never mixed",
    )
    scale: Positive = key(1.0, "factor on the nominal positions")
    start: Literal["targets", "origin"] = key(
        "targets",
        "targets: leaders on theirs, followers scattered about theirs; origin: all scattered about the origin",
    )
    spread: NotNegative = key(1.0, "standard deviation of that scatter, per axis", "m")

    @model_validator(mode="after")
    def _whole(self) -> FormationSection:
        if self.file is not None:
            if self.preset is not None or self.nodes is not None or self.edges is not None:
                raise ValueError("give a file, or a preset, or nodes and edges, not two of them")
            return self
        if self.fields is not None:
            raise ValueError("fields are of a file: give one, or leave them out")
        if self.preset is not None:
            if self.preset not in swarms.NAMES:
                raise ValueError(f"no preset {self.preset!r}; {among(self.preset, swarms.NAMES)}")
            if self.nodes is not None or self.edges is not None:
                raise ValueError("give a preset, or nodes and edges, not both")
        elif self.nodes is None or self.edges is None or self.leaders is None:
            raise ValueError("give a preset, or nodes, edges and leaders, or a file of them")
        elif len({len(node) for node in self.nodes}) != 1 or len(self.nodes[0]) not in (2, 3):
            raise ValueError("nodes need two coordinates each, or three each")
        return self


class Keyframe(Section):
    """An affine map at a time: targets are theta p_i + offset, in metres; or theta p_i turned by an angle (rad), + offset."""

    time: NotNegative = key(..., "when the map holds", "s")
    theta: Matrix = key(..., "the map: targets are theta p_i + offset")
    offset: list[Finite] = key(..., "what is added", "m")
    angle: Finite | None = key(
        None,
        "by how much theta p_i is turned, counterclockwise, in space about the third axis; in every "
        "keyframe, or in none. Entries of theta go straight: half a turn by them passes through a point",
        "rad",
    )


class ManoeuvreSection(Section):
    """What the leaders fly: a preset, or keyframes or the paths of a file, joined by monotone cubics."""

    preset: Literal["hover", "corridor", "ravine"] | None = key(None, "a manoeuvre by name, in place of keyframes")
    keyframes: list[Keyframe] = key(list, "affine maps at times, joined by monotone cubics; at rest before and after")
    file: str | None = key(
        None, "CSV of a path of the formation (time,x,y), or of each leader (time,leader,x,y), in place of keyframes"
    )
    walls: list[Annotated[Matrix, Field(min_length=2)]] = key(
        list, "lines through points that recordings and pictures show; nothing collides with them", "m"
    )

    @model_validator(mode="after")
    def _whole(self) -> ManoeuvreSection:
        if [self.preset is not None, bool(self.keyframes), self.file is not None].count(True) != 1:
            raise ValueError("give a preset ('hover', 'corridor', 'ravine'), or keyframes, or a file")
        if self.keyframes and len(self.keyframes) < 2:
            raise ValueError("give at least two keyframes")
        refuse_unordered("keyframe times", [frame.time for frame in self.keyframes])
        if len({frame.angle is None for frame in self.keyframes}) > 1:
            raise ValueError("give every keyframe an angle (rad), or none")
        return self


class TimeSection(Section):
    """Ticks of dt seconds for duration seconds. `next-tick` delivers no message before the next tick.

    Over processes a run has stalled when nothing has moved for `patience` seconds. In `real` time a tick begins when its time
    has come, whoever has answered by then.
    """

    dt: Tick = key(..., "tick", "s")
    duration: Positive = key(..., "length of the run, a whole number of ticks", "s")
    patience: Annotated[float, Field(ge=2.0, le=3600.0)] = key(
        3.0,
        "over processes: how long nothing may move before the run has stalled, and what an agent may compute in one go",
        "s",
    )
    mode: Literal["lockstep", "real"] = key(
        "lockstep", "lockstep: a tick begins when everybody has answered; real: when its time has come"
    )
    exchange: Literal["same-tick", "next-tick"] = key(
        "same-tick", "same-tick: undelayed broadcasts arrive in the tick they are sent; next-tick: one later"
    )
    real: RealTimeSection = key(RealTimeSection(), "of runs in real time")

    @property
    def ticks(self) -> int:
        """How many ticks the run has."""
        return round(self.duration / self.dt)

    @model_validator(mode="after")
    def _whole(self) -> TimeSection:
        if abs(self.ticks * self.dt - self.duration) > 1e-6 * self.dt or not self.ticks:
            raise ValueError(f"duration {self.duration:g} s is not a whole number of ticks of {self.dt:g} s")
        return self


class AgentsSection(Section):
    """What the agents run: names of estimator and law, and their parameters by name; leader_gain in 1/s.

    `limit` is the longest input they command, in m/s, or m/s2 of double integrators: longer ones are shortened. `per_process`
    is how many of them a process carries; `programs` are command lines of programs that fly some of them, by their numbers.
    """

    estimator: str = key(..., 'by name, or "module:Class" (`affinet list estimators`)')
    law: str = key(..., 'by name, or "module:Class" (`affinet list laws`)')
    leaders: Literal["pilot", "distances"] = key(
        "pilot",
        "pilot: they fly the manoeuvre; distances: they keep their nominal distances from each other, "
        "anywhere, and must all see each other",
    )
    leader_gain: NotNegative = key(1.0, "pull of a leader toward its target; toward distances in 1/(s m2)", "1/s")
    limit: Positive | None = key(
        None, "the longest input, longer ones are shortened; m/s2 of double integrators", "m/s"
    )
    per_process: Annotated[int, Field(ge=1, le=1000)] = key(
        1, "how many agents a process carries, as one batch; the bits are the same"
    )
    programs: Annotated[dict[str, str], AfterValidator(of_agents)] = key(
        dict,
        "command lines of programs that fly some agents in place of ours, over processes, by their numbers: "
        '{ "3" = "python my_agent.py" }; they start in the working directory of `affinet`',
    )
    parameters: dict[str, dict[str, Any]] = key(
        dict,
        "a table for each estimator or law, by name, like [agents.parameters.ga-rkf]; those not in use are checked too",
    )


class TrustSection(Section):
    """What is taken from agents: whether a wrong message fails the run, or is dropped while the right one is waited for.

    The largest message, in bytes, and how many of an agent are looked at in a tick.
    """

    wrong_messages: Literal["fail", "drop"] = key(
        "fail",
        "fail: a wrong message ends the run, and the agent is named; drop: it is dropped and counted, and "
        "the right one is waited for as long as `time.patience` lets it",
    )
    largest_message: Annotated[int, Field(ge=1 << 10, le=1 << 22)] = key(1 << 20, "what an agent may say at once", "B")
    messages_per_tick: Annotated[int, Field(ge=10, le=1_000_000)] = key(
        100, "how many messages of an agent are looked at in a tick; of more nothing is read"
    )


class RecordSection(Section):
    """The Rerun recording, and the realised graph: one moment every so many ticks, joint over a window in seconds."""

    enabled: bool = key(True, "write run.rrd")
    every: Annotated[int, Field(ge=1, le=10_000)] = key(
        5, "ticks from one recorded moment, and one look at the realised graph, to the next"
    )
    window: Positive = key(1.0, "over which links count as working together", "s")


class Scenario(Section):
    """A whole scenario."""

    description: str = key("", "for people")
    seed: Annotated[int, Field(ge=0, lt=2**64)] = key(1, "of every draw")
    formation: FormationSection = key(..., "who flies")
    manoeuvre: ManoeuvreSection = key(..., "what the leaders fly")
    time: TimeSection = key(..., "ticks, and how long it goes")
    sensing: SensingSection = key(..., "what is measured of neighbours")
    dynamics: DynamicsSection = key(DynamicsSection(), "what bodies are, and what displaces them")
    target: TargetSection | None = key(None, "of agents that pursue one")
    world: Literal["simulated", "recorded", "external"] = key(
        "simulated",
        "where bodies and sensors are: simulated; recorded, a flight that was flown before; external, robots outside",
    )
    recorded: RecordedSection | None = key(None, "of a world that was recorded")
    external: ExternalSection | None = key(None, "of a world of robots outside")
    agents: AgentsSection = key(..., "what the agents run")
    network: NetworkSection = key(NetworkSection(), "what happens to messages")
    timeline: list[AnyEvent] = key(list, "faults, each with a verb and a time (`affinet list verbs`)")
    trust: TrustSection = key(TrustSection(), "what is taken from agents, over processes")
    record: RecordSection = key(RecordSection(), "what is recorded")
    _source: Source | None = PrivateAttr(default=None)
    _own: dict[str, Path] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _of_its_world(self) -> Scenario:
        for name, says in (("recorded", 'flight = "FILE"'), ("external", 'driver = "COMMAND"')):
            if (getattr(self, name) is None) == (self.world == name):
                missing = f'world = "{name}" needs a table [{name}] with {says}'
                raise ValueError(
                    missing if self.world == name else f'[{name}] is of world = "{name}", not of "{self.world}"'
                )
        return self

    @property
    def own_modules(self) -> dict[str, Path]:
        """The folders of the user's own in which modules of its algorithms lie, by "module:Class"."""
        return self._own

    @property
    def source(self) -> Source:
        """Where it came from."""
        return self._source or IN_CODE

    def locate(self, error: ScenarioError) -> ScenarioError:
        """The same error, whose text begins with a key, with the place where that key was given."""
        key = str(error).partition(": ")[0]  # "module:Class" may be part of it
        return ScenarioError(f"{self._source.place(key)}: {error}") if self._source else error
