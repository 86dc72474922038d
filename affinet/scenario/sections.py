"""The tables of a scenario file as typed models: an unknown key, a wrong type or an impossible value is an error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from affinet.scenario.events import Links
from affinet.scenario.keys import key
from affinet.scenario.outside import ExternalSection, RecordedSection
from affinet.scenario.profiles import LinkProfile, Section
from affinet.scenario.programs import of_agents
from affinet.scenario.real_time import RealTimeSection
from affinet.scenario.selectors import edge
from affinet.scenario.source import IN_CODE, Source
from affinet.scenario.target import TargetSection
from affinet.scenario.units import (
    Bearing,
    Below1,
    Finite,
    NotNegative,
    Positive,
    Probability,
    ShareOfDistance,
    Steps,
    Tick,
    Ticks,
    refuse_unordered,
)
from affinet.scenario.verbs import AnyEvent
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError
from analysis.models.sensor import Sensor
from world.formation import swarms
from world.physics.bodies import BodyModel

Matrix = list[list[Finite]]


def _edge(text: str) -> str:
    edge(text)
    return text


Edge = Annotated[str, AfterValidator(_edge)]


class FormationSection(Section):
    """Who flies: a preset, or nodes, edges and leaders. Positions in metres, agents numbered from 1.

    `weights` of one's own take the place of the stress that is solved for: of each edge i-j one number, or what i gives j and
    what j gives i.
    """

    preset: str | None = key(
        None, "a formation by name, in place of nodes, edges and leaders: " + ", ".join(swarms.NAMES)
    )
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
        if self.preset is not None:
            if self.preset not in swarms.NAMES:
                raise ValueError(f"no preset {self.preset!r}; {among(self.preset, swarms.NAMES)}")
            if self.nodes is not None or self.edges is not None:
                raise ValueError("give a preset, or nodes and edges, not both")
        elif self.nodes is None or self.edges is None or self.leaders is None:
            raise ValueError("give a preset, or nodes, edges and leaders")
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
    """What the leaders fly: a preset, or keyframes joined by monotone cubics."""

    preset: Literal["hover", "corridor", "ravine"] | None = key(None, "a manoeuvre by name, in place of keyframes")
    keyframes: list[Keyframe] = key(list, "affine maps at times, joined by monotone cubics; at rest before and after")
    walls: list[Annotated[Matrix, Field(min_length=2)]] = key(
        list, "lines through points that recordings and pictures show; nothing collides with them", "m"
    )

    @model_validator(mode="after")
    def _whole(self) -> ManoeuvreSection:
        if (self.preset is None) == (not self.keyframes):
            raise ValueError("give a preset ('hover', 'corridor', 'ravine'), or keyframes")
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


# What says how wrong the sensor is, one of these.
SENSORS = (
    ("sigma",),
    ("covariance",),
    ("sigma_range", "sigma_bearing"),
    ("sigma_along", "sigma_across"),
    ("sigma_direction",),
)


class SensingSection(Section):
    """The relative position sensor: a standard deviation in metres, or a covariance in square metres, of one measurement.

    Or those of a range, in metres, and of a bearing, in radians (in three dimensions azimuth and elevation); or those along and
    across the line of sight, as shares of the distance. Or that of a direction, in radians, of a sensor that says no distance.
    It makes `samples` of them in a tick, and reports their mean.
    """

    samples: Steps = key(
        1, "measurements of an edge in a tick, of which the sensor reports the mean: its covariance is R / samples"
    )
    sigma: NotNegative | None = key(None, "standard deviation of a relative measurement, per axis", "m")
    covariance: Matrix | None = key(None, "or its covariance", "m2")
    sigma_range: Positive | None = key(None, "or the standard deviation of a range, with sigma_bearing", "m")
    sigma_bearing: Bearing | None = key(
        None,
        "and of a bearing, in three dimensions of azimuth and elevation. The covariance of a measurement is "
        "then exact ((4.3)-(4.4) of paper 004) and its own; for estimators that fit no map",
        "rad",
    )
    sigma_along: ShareOfDistance | None = key(
        None,
        "or the standard deviation along the line of sight, as a share of the distance, with sigma_across "
        "(section VII of paper 003)",
    )
    sigma_across: ShareOfDistance | None = key(None, "and across it, as a share of the distance")
    sigma_direction: Bearing | None = key(
        None,
        "or that of a direction, in three dimensions to either side, of a sensor that says no distance: a "
        "unit vector. For `edge-kf`, which begins at the nominal distance and finds the true one where "
        "neighbours fly across the line of sight",
        "rad",
    )

    @model_validator(mode="after")
    def _whole(self) -> SensingSection:
        if (self.sigma_range is None) != (self.sigma_bearing is None):
            raise ValueError("sigma_range (m) and sigma_bearing (rad) go together")
        if (self.sigma_along is None) != (self.sigma_across is None):
            raise ValueError("sigma_along and sigma_across (shares of the distance) go together")
        given = [name for kind in SENSORS for name in kind if getattr(self, name) is not None]
        if sum(kind[0] in given for kind in SENSORS) != 1:
            also = f"; one of them, where {' and '.join(given)} are given" if given else ""
            raise ValueError(
                "give sigma (m), or covariance (m2), or sigma_range (m) and sigma_bearing (rad), "
                f"or sigma_along and sigma_across (shares of the distance), or sigma_direction (rad){also}"
            )
        if self.sigma == 0.0:
            raise ValueError("sigma 0 would make every filter divide by zero; give a small one, like 1e-6 m")
        return self


class KernelSection(Section):
    """How disturbances of two agents are correlated by their distance; `length` in metres, 2 for paper 004 (4.14)."""

    shape: Literal["exponential", "squared-exponential"] = key(
        "exponential", "how the correlation falls: exp(-d / length), or by the square"
    )
    length: Positive = key(..., "over which it falls", "m")
    positions: Literal["nominal", "true"] = key("nominal", "of which distances are taken")


BodyName = Literal["single-integrator", "double-integrator", "triple-integrator", "quadruple-integrator", "unicycle"]
INTEGRATORS: tuple[BodyName, ...] = get_args(BodyName)[:4]  # by their order, from 1
# The keys of each kind of body beside those that all have.
_OF_BODIES: dict[str, tuple[str, ...]] = {"unicycle": ("ahead",)}


class DynamicsSection(Section):
    """What the bodies are, and what displaces them in a tick: a standard deviation per axis, in metres, or a covariance, in m2.

    `kernel` correlates agents, `persistence` successive ticks. A unicycle is steered by a point so many metres `ahead` of its
    wheels.
    """

    model: BodyName = key(
        "single-integrator",
        "how often bodies integrate their input (velocities, accelerations, jerks, snaps) to a position; "
        "the latter two fly after a target, without leaders. unicycle: wheels that roll along a heading, in "
        "two dimensions, steered by velocities",
    )
    ahead: Positive | None = key(
        None,
        "of a unicycle, which needs it: how far ahead of its wheels it is steered. It rolls as fast as its "
        "heading has of the input, and turns at what is left of it by this length",
        "m",
    )
    disturbance: NotNegative | None = key(None, "standard deviation of the displacement per tick, per axis", "m")
    covariance: Matrix | None = key(None, "or its covariance", "m2")
    kernel: KernelSection | None = key(
        None, "correlation Q_A of the displacements of agents by their distance, Q = Q_A x Q_D"
    )
    persistence: Below1 = key(0.0, "correlation of a displacement with that of the tick before")

    @model_validator(mode="after")
    def _one(self) -> DynamicsSection:
        if self.disturbance is not None and self.covariance is not None:
            raise ValueError("give disturbance (m) or covariance (m2), not both")
        return self

    @model_validator(mode="after")
    def _of_its_body(self) -> DynamicsSection:
        for model, keys in _OF_BODIES.items():
            for name in keys:
                if (getattr(self, name) is None) == (self.model == model):
                    missing = f"a {model} needs {name} (m)"
                    raise ValueError(
                        missing if self.model == model else f"{name} is of a {model}, not of a {self.model}"
                    )
        return self

    @property
    def body(self) -> BodyModel:
        """What the bodies are."""
        return BodyModel(self.model, {key: getattr(self, key) for key in _OF_BODIES.get(self.model, ())})

    @property
    def order(self) -> int:
        """How often the input is integrated to a position."""
        return self.body.build().order


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


class LinkSetting(Section):
    """Links that differ from the others, in all channels or in those of one class."""

    links: Links = key(..., 'which, like "2->4", "2-4", "leaders->followers"')
    channels: Literal["sensing", "comms"] | None = key(None, "only those of this class")
    profile: str | None = key(None, "what happens on them, in place of the profile of all")
    availability: Probability | None = key(None, "probability that a message gets through")
    delay_ticks: Ticks | None = key(None, "one-way delay of communication, in ticks")


class JammedZone(Section):
    """A disk (ball) in which nobody hears anything in a `share` of all ticks, all at once; metres."""

    centre: list[Finite] = key(..., "of the disk, or ball", "m")
    radius: Positive = key(..., "of it", "m")
    share: Probability = key(1.0, "of all ticks in which nobody in it hears anything")
    links: Links = key("all", "to which links it does so")
    channels: Literal["sensing", "comms"] | None = key(None, "only to channels of this class")


class NetworkSection(Section):
    """The air: a named profile, on top of an availability (probability that a message passes) and a delay in ticks, one way.

    `coupled` is Assumption 1 of paper 000: one verdict per directed link and tick for sensing and communication.
    """

    availability: Probability = key(1.0, "probability that a message gets through")
    delay_ticks: Ticks = key(0, "one-way delay of communication, in ticks; sensing is not delayed")
    coupled: bool = key(True, "one verdict per directed link and tick for sensing and communication (Assumption 1)")
    profile: str = key("perfect", "what happens on all links, by name (`affinet list profiles`)")
    profiles: dict[str, LinkProfile] = key(dict, "profiles of your own, a table each")
    links: list[LinkSetting] = key(list, "links that differ from the others; later ones win")
    zones: list[JammedZone] = key(list, "disks (balls) in which nobody hears anything")

    @model_validator(mode="after")
    def _apart(self) -> NetworkSection:
        if self.coupled and any(setting.channels for setting in self.links):
            raise ValueError("links set channels apart, but coupled = true gives sensing and comms one verdict")
        return self


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


def sensor(sensing: SensingSection, dimension: int) -> Sensor:
    """What says the mean of a tick's T measurements of an edge; what it reads has the covariance R / T.

    Raises
    ------
    ScenarioError
        When that is no covariance of this dimension.
    """
    if sensing.sigma_range is not None and sensing.sigma_bearing is not None:
        deviations = np.array([sensing.sigma_range] + [sensing.sigma_bearing] * (dimension - 1))
        return Sensor("range-bearing", np.diag(deviations**2) / sensing.samples)
    if sensing.sigma_along is not None and sensing.sigma_across is not None:
        deviations = np.array([sensing.sigma_along] + [sensing.sigma_across] * (dimension - 1))
        return Sensor("line-of-sight", np.diag(deviations**2) / sensing.samples)
    if sensing.sigma_direction is not None:
        return Sensor("direction", sensing.sigma_direction**2 * np.eye(dimension - 1) / sensing.samples)
    R = _covariance("sensing", sensing.sigma, sensing.covariance, dimension)
    return Sensor("coordinates", R / sensing.samples)


def displacement(dynamics: DynamicsSection, dimension: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Q_D of one agent in a tick, shape (D, D), in square metres.

    Raises
    ------
    ScenarioError
        When it is no covariance of this dimension.
    """
    return _covariance("dynamics", dynamics.disturbance, dynamics.covariance, dimension)


def _covariance(
    section: str, sigma: float | None, given: Matrix | None, dimension: int
) -> np.ndarray[Any, np.dtype[np.float64]]:
    if given is None:
        return float(sigma or 0.0) ** 2 * np.eye(dimension)
    matrix = array(f"{section}.covariance", given, (dimension, dimension))
    if (matrix != matrix.T).any() or np.linalg.eigvalsh(matrix)[0] <= 0:
        raise ScenarioError(f"{section}.covariance: must be symmetric and positive definite, in m2")
    return matrix


def array(key: str, rows: Sequence[Any], shape: tuple[int, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Nested lists as an array of this shape.

    Raises
    ------
    ScenarioError
        When they have another.
    """
    try:
        values = np.array(rows, dtype=np.float64)
    except ValueError:
        values = np.empty(0)
    if values.shape != shape:
        raise ScenarioError(f"{key}: must be {' x '.join(map(str, shape))} numbers")
    return values
