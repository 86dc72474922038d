"""The tables of a scenario file as typed models: an unknown key, a wrong type or an impossible value is an error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from affinet.scenario.events import Links
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
from analysis.models.sensor import Sensor
from world.formation import swarms
from world.physics.bodies import BodyModel

Matrix = list[list[Finite]]


class ScenarioError(ValueError):
    """What is wrong in a scenario, in one line: file, key, and what would be right."""


def _edge(text: str) -> str:
    edge(text)
    return text


@contextmanager
def said_at(key: str) -> Iterator[None]:
    """What is wrong in the block is said as a problem of this key."""
    try:
        yield
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(f"{key}: {error}") from error


Edge = Annotated[str, AfterValidator(_edge)]


class FormationSection(Section):
    """Who flies: a preset, or nodes, edges and leaders. Positions in metres, agents numbered from 1.

    `weights` of one's own take the place of the stress that is solved for: of each edge i-j one number, or what i gives j and
    what j gives i.
    """

    preset: str | None = None
    nodes: Matrix | None = None
    edges: list[Edge] | None = None
    leaders: list[int] | None = None
    weights: list[Finite] | Matrix | None = None
    scale: Positive = 1.0
    start: Literal["targets", "origin"] = "targets"
    spread: NotNegative = 1.0

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

    time: NotNegative
    theta: Matrix
    offset: list[Finite]
    angle: Finite | None = None


class ManoeuvreSection(Section):
    """What the leaders fly: a preset, or keyframes joined by monotone cubics.

    `walls` are lines through points, in metres, that pictures show.
    """

    preset: Literal["hover", "corridor", "ravine"] | None = None
    keyframes: list[Keyframe] = Field(default_factory=list)
    walls: list[Annotated[Matrix, Field(min_length=2)]] = Field(default_factory=list)

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

    dt: Tick
    duration: Positive
    patience: Annotated[float, Field(ge=2.0, le=3600.0)] = 3.0
    mode: Literal["lockstep", "real"] = "lockstep"
    exchange: Literal["same-tick", "next-tick"] = "same-tick"
    real: RealTimeSection = RealTimeSection()

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

    samples: Steps = 1
    sigma: NotNegative | None = None
    covariance: Matrix | None = None
    sigma_range: Positive | None = None
    sigma_bearing: Bearing | None = None
    sigma_along: ShareOfDistance | None = None
    sigma_across: ShareOfDistance | None = None
    sigma_direction: Bearing | None = None

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

    shape: Literal["exponential", "squared-exponential"] = "exponential"
    length: Positive
    positions: Literal["nominal", "true"] = "nominal"


BodyName = Literal["single-integrator", "double-integrator", "triple-integrator", "quadruple-integrator", "unicycle"]
INTEGRATORS: tuple[BodyName, ...] = get_args(BodyName)[:4]  # by their order, from 1
# The keys of each kind of body beside those that all have.
_OF_BODIES: dict[str, tuple[str, ...]] = {"unicycle": ("ahead",)}


class DynamicsSection(Section):
    """What the bodies are, and what displaces them in a tick: a standard deviation per axis, in metres, or a covariance, in m2.

    `kernel` correlates agents, `persistence` successive ticks. A unicycle is steered by a point so many metres `ahead` of its
    wheels.
    """

    model: BodyName = "single-integrator"
    ahead: Positive | None = None
    disturbance: NotNegative | None = None
    covariance: Matrix | None = None
    kernel: KernelSection | None = None
    persistence: Below1 = 0.0

    @model_validator(mode="after")
    def _one(self) -> DynamicsSection:
        if self.disturbance is not None and self.covariance is not None:
            raise ValueError("give disturbance (m) or covariance (m2), not both")
        return self

    @model_validator(mode="after")
    def _of_its_body(self) -> DynamicsSection:
        for model, keys in _OF_BODIES.items():
            for key in keys:
                if (getattr(self, key) is None) == (self.model == model):
                    missing = f"a {model} needs {key} (m)"
                    raise ValueError(
                        missing if self.model == model else f"{key} is of a {model}, not of a {self.model}"
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

    estimator: str
    law: str
    leaders: Literal["pilot", "distances"] = "pilot"
    leader_gain: NotNegative = 1.0
    limit: Positive | None = None
    per_process: Annotated[int, Field(ge=1, le=1000)] = 1
    programs: Annotated[dict[str, str], AfterValidator(of_agents)] = Field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = Field(default_factory=dict)


class LinkSetting(Section):
    """Links that differ from the others, in all channels or in those of one class."""

    links: Links
    channels: Literal["sensing", "comms"] | None = None
    profile: str | None = None
    availability: Probability | None = None
    delay_ticks: Ticks | None = None


class JammedZone(Section):
    """A disk (ball) in which nobody hears anything in a `share` of all ticks, all at once; metres."""

    centre: list[Finite]
    radius: Positive
    share: Probability = 1.0
    links: Links = "all"
    channels: Literal["sensing", "comms"] | None = None


class NetworkSection(Section):
    """The air: a named profile, on top of an availability (probability that a message passes) and a delay in ticks, one way.

    `coupled` is Assumption 1 of paper 000: one verdict per directed link and tick for sensing and communication.
    """

    availability: Probability = 1.0
    delay_ticks: Ticks = 0
    coupled: bool = True
    profile: str = "perfect"
    profiles: dict[str, LinkProfile] = Field(default_factory=dict)
    links: list[LinkSetting] = Field(default_factory=list)
    zones: list[JammedZone] = Field(default_factory=list)

    @model_validator(mode="after")
    def _apart(self) -> NetworkSection:
        if self.coupled and any(setting.channels for setting in self.links):
            raise ValueError("links set channels apart, but coupled = true gives sensing and comms one verdict")
        return self


class TrustSection(Section):
    """What is taken from agents: whether a wrong message fails the run, or is dropped while the right one is waited for.

    The largest message, in bytes, and how many of an agent are looked at in a tick.
    """

    wrong_messages: Literal["fail", "drop"] = "fail"
    largest_message: Annotated[int, Field(ge=1 << 10, le=1 << 22)] = 1 << 20
    messages_per_tick: Annotated[int, Field(ge=10, le=1_000_000)] = 100


class RecordSection(Section):
    """The Rerun recording, and the realised graph: one moment every so many ticks, joint over a window in seconds."""

    enabled: bool = True
    every: Annotated[int, Field(ge=1, le=10_000)] = 5
    window: Positive = 1.0


class Scenario(Section):
    """A whole scenario."""

    description: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 1
    formation: FormationSection
    manoeuvre: ManoeuvreSection
    time: TimeSection
    sensing: SensingSection
    dynamics: DynamicsSection = DynamicsSection()
    target: TargetSection | None = None
    world: Literal["simulated", "recorded", "external"] = "simulated"
    recorded: RecordedSection | None = None
    external: ExternalSection | None = None
    agents: AgentsSection
    network: NetworkSection = NetworkSection()
    timeline: list[AnyEvent] = Field(default_factory=list)
    trust: TrustSection = TrustSection()
    record: RecordSection = RecordSection()
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
