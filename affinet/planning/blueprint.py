"""Scenario -> the world that is flown, and what its agents are told of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from affinet.planning import graphs, paths
from affinet.planning.lateness import Lateness
from affinet.scenario import bodies, matrices, selectors
from affinet.scenario.sections import GraphFields, Scenario, TimeSection
from affinet.scenario.target import TargetSection, Waypoint
from affinet.scenario.wrong import ScenarioError
from agents.brief import Brief
from agents.swarm import SwarmBrief
from analysis.models.affine import Manoeuvre
from analysis.models.arrays import Array
from analysis.models.pursuit import Target
from netem.core.links import Links
from netem.impairments.measured import MeasuredError
from netem.loading.given import protect
from world.formation import manoeuvre, swarms
from world.formation.nominal import Formation
from world.physics.bodies import BodyModel
from world.physics.detectors import Detectors
from world.physics.disturbance import Disturbance, Kernel
from world.physics.target import MovingTarget
from world.physics.world import World

# Presets that are flown in so many dimensions.
_MANOEUVRES = {"corridor": (2, manoeuvre.corridor), "ravine": (3, manoeuvre.ravine)}


class Keyframes(NamedTuple):
    """Times (s), theta (F, D, D), offset (F, D), in metres, and angle (F,), in radians, if there is one."""

    times: Sequence[float]
    theta: Array
    offset: Array
    angle: Array | None


def formation_of(given: Scenario) -> Formation:
    """Who flies.

    Raises
    ------
    ScenarioError
        When an edge or a leader is nobody, or weights are of other edges.
    """
    section = given.formation
    if section.file is not None:
        read = _graph(Path(section.file), section.fields or GraphFields())
        nodes, edges, leaders = read.nominal, read.edges, read.leaders
    elif section.preset:
        preset = swarms.preset(section.preset)
        nodes, edges, leaders = preset.nominal, preset.edges, preset.leaders
    else:
        nodes = np.array(section.nodes, dtype=np.float64)
        edges = tuple(selectors.edge(edge) for edge in section.edges or [])
        leaders = ()
    leaders = leaders if section.leaders is None else tuple(section.leaders)
    for key, numbers in (("leaders", leaders), ("edges", [agent for edge in edges for agent in edge])):
        if strangers := sorted({agent for agent in numbers if not 1 <= agent <= len(nodes)}):
            raise ScenarioError(f"formation.{key}: no agents {strangers}; agents are 1 to {len(nodes)}")
    return Formation(section.scale * nodes, edges, leaders, _weights(given, len(edges)))


def _graph(file: Path, fields: GraphFields) -> graphs.Graph:
    try:
        return graphs.read(file, fields)
    except FileNotFoundError as error:
        raise ScenarioError(f"formation.file: {file}: no such file") from error
    except (OSError, MeasuredError) as error:
        raise ScenarioError(f"formation.file: {file}: {error}") from error


def _weights(given: Scenario, edges: int) -> Array | None:
    section = given.formation
    if section.weights is None:
        return None
    both_ways = any(isinstance(weight, list) for weight in section.weights)
    weights = matrices.array("formation.weights", section.weights, (edges, 2) if both_ways else (edges,))
    return weights if both_ways else np.column_stack([weights, weights])


def world_of(given: Scenario, formation: Formation) -> World:
    """Its physics, sensors and manoeuvre.

    Raises
    ------
    ScenarioError
        When a covariance or a manoeuvre does not fit the formation.
    """
    return World(
        run_seed=given.seed,
        swarm_seeds=None,
        dt=given.time.dt,
        ticks=given.time.ticks,
        body=_body(given, formation.dimension),
        formation=formation,
        links=Links.both_ways(formation.agents, formation.edges),
        manoeuvre=_manoeuvre(given, formation),
        sensor=bodies.sensor(given.sensing, formation.dimension),
        disturbance=_disturbance(given, formation.dimension),
        pursuit=_pursuit(given, formation),
        start=given.formation.start,
        spread=given.formation.spread,
        swarms=1,
        flight=None,
    )


def _body(given: Scenario, dimension: int) -> BodyModel:
    body = given.dynamics.body
    if dimension not in (flown_in := body.build().dimensions):
        said = " or ".join(map(str, flown_in))
        raise ScenarioError(
            f"dynamics.model: a {body.model} moves in {said} dimensions, and the formation has {dimension}"
        )
    return body


def _disturbance(given: Scenario, dimension: int) -> Disturbance:
    section = given.dynamics
    kernel = None if section.kernel is None else Kernel(**dict(section.kernel))
    return Disturbance(bodies.displacement(section, dimension), kernel, section.persistence)


def _pursuit(given: Scenario, formation: Formation) -> MovingTarget | None:
    section, dt, dimension = given.target, given.time.dt, formation.dimension
    if section is None:
        return None
    ticks = np.round(np.array(section.latencies) / dt).astype(np.int64)
    if (np.abs(ticks * dt - section.latencies) > 1e-6 * dt).any():
        raise ScenarioError(f"target.latencies: {section.latencies} s are not whole numbers of ticks of {dt:g} s")
    target = Target(section.order, section.intensity, ticks, np.array(section.variances, dtype=np.float64))
    driven = section.intensity if section.true_intensity is None else section.true_intensity
    path = None if section.path is None else _course(section.path, section.order, given.time, dimension)
    start = _start(section, dimension) if path is None else path[0]
    return MovingTarget(target, dt, start, driven, path, _detectors(section, formation.agents))


def _detectors(section: TargetSection, agents: int) -> Detectors:
    methods, schedule = len(section.latencies), None
    if section.schedule is not None:
        schedule = np.tile(np.array(section.schedule, dtype=np.int64) - 1, (agents, 1))
    if section.methods is not None:
        if len(section.methods) != agents:
            raise ScenarioError(f"target.methods: give one for each of the {agents} agents, in their order")
        schedule = np.array(section.methods, dtype=np.int64)[:, None] - 1
    even = [1.0 / methods] * methods
    return Detectors(
        probabilities=np.array(section.probabilities or even, dtype=np.float64),
        schedule=schedule,
        misses=section.misses,
        false_positives=section.false_positives,
        clutter=section.clutter,
    )


def _start(section: TargetSection, dimension: int) -> Array:
    start = np.zeros((section.order, dimension))
    for derivative, (key, values) in enumerate((("position", section.position), ("velocity", section.velocity))):
        if values is not None and derivative < section.order:
            start[derivative] = matrices.array(f"target.{key}", values, (dimension,))
    return start


def _course(path: Sequence[Waypoint], order: int, time: TimeSection, dimension: int) -> Array:
    times = [point.time for point in path]
    _refuse_within_a_tick("target.path", times, time.dt)
    points = [
        matrices.array(f"target.path.{number}.position", point.position, (dimension,))
        for number, point in enumerate(path, start=1)
    ]
    seconds: Array = np.arange(time.ticks + 1, dtype=np.float64) * time.dt
    return manoeuvre.course(seconds, times, np.array(points), order)


def _from_file(file: Path, formation: Formation, seconds: Array, dt: float) -> Manoeuvre:
    try:
        return paths.manoeuvre_of(file, formation, seconds, dt)
    except FileNotFoundError as error:
        raise ScenarioError(f"manoeuvre.file: {file}: no such file") from error
    except (OSError, MeasuredError) as error:
        raise ScenarioError(f"manoeuvre.file: {file}: {error}") from error


def _manoeuvre(given: Scenario, formation: Formation) -> Manoeuvre:
    dimension = formation.dimension
    seconds: Array = np.arange(given.time.ticks + 1, dtype=np.float64) * given.time.dt
    section = given.manoeuvre
    for number, wall in enumerate(section.walls, start=1):
        matrices.array(f"manoeuvre.walls.{number}", wall, (len(wall), dimension))
    if section.preset == "hover":
        return manoeuvre.hover(seconds, dimension)
    if section.preset is not None:
        flown_in, flown = _MANOEUVRES[section.preset]
        if dimension != flown_in:
            raise ScenarioError(
                f"manoeuvre.preset: {section.preset!r} is flown in {flown_in} dimensions, not in {dimension}; give keyframes"
            )
        return flown(seconds)
    if section.file is not None:
        return _from_file(Path(section.file), formation, seconds, given.time.dt)
    frames = keyframes_of(given, dimension)
    _refuse_within_a_tick("manoeuvre.keyframes", frames.times, given.time.dt)
    return manoeuvre.keyframes(seconds, *frames)


def _refuse_within_a_tick(key: str, times: Sequence[float], dt: float) -> None:
    for number, (earlier, later) in enumerate(pairwise(times), start=2):
        if later - earlier < dt:
            raise ScenarioError(
                f"{key}.{number}.time: {later:g} s is less than a tick ({dt:g} s) after "
                "the one before; move it, or lower time.dt"
            )


def keyframes_of(given: Scenario, dimension: int) -> Keyframes:
    """What the keyframes of a scenario say.

    Raises
    ------
    ScenarioError
        When one does not fit the formation.
    """
    section, square = given.manoeuvre, (dimension, dimension)
    theta, offset = [], []
    for number, frame in enumerate(section.keyframes, start=1):
        key = f"manoeuvre.keyframes.{number}"
        theta.append(matrices.array(f"{key}.theta", frame.theta, square))
        offset.append(matrices.array(f"{key}.offset", frame.offset, (dimension,)))
    times = [frame.time for frame in section.keyframes]
    angles = [frame.angle for frame in section.keyframes if frame.angle is not None]
    return Keyframes(times, np.array(theta), np.array(offset), np.array(angles) if angles else None)


def brief_of(world: World, L: Array, late: int) -> Brief:
    """The places of all agents, with the stress matrix L, shape (N, N), where messages come so many ticks late at the most."""
    formation, links = world.formation, world.links
    relative = formation.nominal[:, None] - formation.nominal[links.neighbours]
    weights = -np.take_along_axis(L, links.neighbours, axis=1)
    return Brief(
        dt=world.dt,
        number=np.arange(1, formation.agents + 1),
        nominal=formation.nominal,
        relative=np.where(links.present[..., None], relative, 0.0),
        present=links.present,
        back=links.back,
        stress=np.where(links.present, weights, 0.0),
        leads=links.present & formation.is_leader[links.neighbours],
        sensor=world.sensor,
        process=_process(world),
        persistence=world.disturbance.persistence,
        lateness=late,
        leader=formation.is_leader,
        target=None if world.pursuit is None else world.pursuit.target,
        mission=world.manoeuvre,
    )


def swarm_of(given: Scenario, first: World, L: Array, late: Lateness) -> SwarmBrief:
    """The swarm as a whole, from the world of its first tick, the stress matrix L, shape (N, N), and how late messages come."""
    formation, links, disturbance = first.formation, first.links, first.disturbance
    swarm = SwarmBrief(
        dt=first.dt,
        ticks=given.time.ticks,
        order=given.dynamics.order,
        late=late.causes,
        lateness=late.ticks,
        nominal=formation.nominal,
        neighbours=links.neighbours,
        present=links.present,
        leader=formation.is_leader,
        stress=L,
        sensor=first.sensor,
        correlation=disturbance.between(formation.nominal),
        displacement=disturbance.covariance,
        persistence=disturbance.persistence,
    )
    protect(swarm)
    return swarm


def _process(world: World) -> Array:
    """B_i^T Q B_i of every agent's edges, shape (N, n D, n D): what they know of the disturbances."""
    links, Q_D = world.links, world.disturbance.covariance
    Q_A = world.disturbance.between(world.formation.nominal)
    own, theirs = np.arange(links.agents)[:, None], links.neighbours
    first, second = theirs[:, :, None], theirs[:, None, :]
    edges = Q_A[own, own][..., None] - Q_A[own, theirs][:, :, None] - Q_A[own, theirs][:, None, :] + Q_A[first, second]
    real = links.present[:, :, None] & links.present[:, None, :]
    return np.asarray(np.kron(np.where(real, edges, 0.0), Q_D), dtype=np.float64)
