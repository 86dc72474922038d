"""What is checked before anything starts, in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, Literal

import numpy as np

from affinet.planning import stability
from affinet.scenario.finding import Finding
from agents.estimators.conral import ConsensusLocalization
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.ga_rkf import GeometryAwareFilter
from agents.estimators.joint_kf import JointEdgeFilter
from agents.estimators.jor import JacobiOverRelaxation
from agents.estimators.silent import SilentEdgeFilter
from agents.estimators.target import TargetEstimator
from agents.laws.double import DoubleVaryingVelocity
from agents.laws.pursuit import Pursuit
from agents.laws.single import VaryingVelocity
from analysis.metrics import localization
from analysis.models.arrays import Array
from analysis.models.graph import reached
from netem.faults.fault import Fault
from world.books.localized import FirstMeasurements
from world.formation import manoeuvre as manoeuvres
from world.formation import stress
from world.formation.nominal import Formation
from world.physics import sensors
from world.physics.world import World

_SMALL_CHATTER = 1.0
_FORGOTTEN = 2.0  # an Euler step of -gamma diverges from here on
_NARROW = 0.7  # a quarter turn by the entries of theta gets no narrower
_ROUNDING = 1e-6


def graph(formation: Formation) -> list[Finding]:
    """Whether the graph joins all agents."""
    if formation.agents < 2:
        return [Finding("graph", "error", "one agent has nobody to see or hear: give a second node, and an edge to it")]
    return [_connected(formation), _edges(formation)]


def leaders_apart(formation: Formation) -> Finding:
    """Whether all leaders see each other, as those that keep their distances must."""
    seen = {frozenset(edge) for edge in formation.edges}
    missing = [f"{i}-{j}" for i, j in combinations(sorted(formation.leaders), 2) if frozenset((i, j)) not in seen]
    if missing:
        says = f"leaders that keep their distances must all see each other: there is no edge {', '.join(missing)}"
        return Finding("leaders apart", "error", says)
    return Finding("leaders apart", "ok", "the leaders all see each other, and can keep their distances")


def led(
    formation: Formation, leaders: Literal["pilot", "distances"], order: int, gain: float, dt: float
) -> list[Finding]:
    """Whether a tick is short enough for the pull of the leaders toward their targets, or toward their distances."""
    if not formation.leaders or not gain:
        return []
    if leaders == "pilot":
        most = (2.0, 1.0)[order - 1] / dt
        unit, radius = "1/s", stability.radius(stability.chain_step(((gain,), (gain**2, 2.0 * gain))[order - 1], dt))
    else:
        places = formation.nominal[formation.is_leader]
        stretch = 2.0 * stability.stretch_eigenvalue(places)
        most, unit, radius = 2.0 / (dt * stretch), "1/(s m2)", abs(1.0 - dt * gain * stretch)
    if gain < most:
        return [Finding("leader gain", "ok", f"{gain:g} {unit} is below the bound {most:.4g} at dt {dt:g} s")]
    says = f"{gain:g} {unit} is not below the bound {most:.4g} at dt {dt:g} s (radius {radius:.4g}): leaders diverge"
    return [Finding("leader gain", "error", f"{says}; lower agents.leader_gain, or dt")]


def pursued(law: Any, dt: float) -> list[Finding]:
    """Whether a tick is short enough for the pull of those who are after a target."""
    if not isinstance(law, Pursuit):
        return []
    radius = stability.radius(stability.chain_step(law.kappa, dt))
    if radius < 1.0:
        settles = f"settles to 1/e in {_settle(radius, dt)}"
        return [Finding("step", "ok", f"radius {radius:.6f} < 1 at dt {dt:g} s, kappa {list(law.kappa)}: {settles}")]
    says = f"radius {radius:.4g} >= 1 at dt {dt:g} s: the step is too long for kappa {list(law.kappa)}; lower it, or dt"
    return [Finding("step", "error", says)]


def averaging(estimator: Any, ticks: int) -> list[Finding]:
    """Whether a window of ticks fits into a run of so many."""
    if not isinstance(estimator, SilentEdgeFilter) or estimator.window < ticks:
        return []
    says = f"a window of {estimator.window} ticks is never full in a run of {ticks}; give at most {ticks - 1}"
    return [Finding("window", "error", says)]


def forgetting(estimator: Any, dt: float) -> list[Finding]:
    """Whether a tick is short enough for REDCHO to forget what it has gathered, by gamma."""
    if not (isinstance(estimator, TargetEstimator) and estimator.fusion == "redcho"):
        return []
    fastest = max(estimator.gamma)
    if fastest * dt < _FORGOTTEN:
        return []
    says = f"gamma {fastest:g} 1/s is not below the bound {_FORGOTTEN / dt:g} at dt {dt:g} s: REDCHO diverges; lower it, or dt"
    return [Finding("REDCHO", "error", says)]


def maneuver(times: Sequence[float], theta: Array, angle: Array | None) -> list[Finding]:
    """What keyframes make of a formation on the way from one to the next."""
    share = manoeuvres.narrowest(times, theta)
    turns = manoeuvres.turned(theta, np.zeros(len(theta)) if angle is None else angle)
    told = f"the formation turns by {', '.join(f'{turn:.3g}' for turn in turns)} rad from keyframe to keyframe"
    found = [Finding("manoeuvre", "ok", told)]
    if (most := float(np.abs(turns).max())) > 2.0 * np.pi:
        says = f"from one keyframe to the next it turns {most / (2.0 * np.pi):.3g} times round; angles are in radians"
        found.append(Finding("manoeuvre", "note", says))
    for number, (narrow, earlier, later) in enumerate(zip(share, theta[:-1], theta[1:], strict=True), start=1):
        legs = f"keyframes {number} to {number + 1}"
        if narrow < _NARROW:
            says = f"{legs}: on the way the formation shrinks to {narrow:.1%} of its width, as entries of theta go straight"
            found.append(Finding("manoeuvre", "note", f"{says}; to turn it, give keyframes an angle (rad)"))
        elif (earlier != later).any() and np.allclose(earlier, later, rtol=0.0, atol=_ROUNDING):
            says = f"{legs}: theta is the same but for rounding, and nothing turns"
            found.append(Finding("manoeuvre", "note", f"{says}; for a full turn, give keyframes an angle (rad)"))
    return found


def in_time(estimator: Any, late: bool) -> list[Finding]:
    """Whether what an estimator takes for the present arrives in the tick it is of."""
    if late and isinstance(estimator, EdgeKalmanFilter | JointEdgeFilter):
        says = (
            "inputs are heard ticks late, and taken for those of this tick: the filters will be too sure of themselves"
        )
        return [Finding("inputs", "note", says)]
    if late and isinstance(estimator, TargetEstimator) and estimator.fusion != "none":
        says = "information is heard ticks late, and taken for that of this tick: the target is put where it was"
        return [Finding("information", "note", says)]
    return []


def chatter(estimator: Any, dt: float) -> list[Finding]:
    """How hard REDCHO's sign switches in a tick (errata of paper 002)."""
    if not (isinstance(estimator, TargetEstimator) and estimator.fusion == "redcho"):
        return []
    order = len(estimator.k) - 1
    switched = estimator.k[order] * estimator.theta ** (order + 1) * dt
    says = (
        f"REDCHO switches its highest derivative by {switched:.3g} a tick (k_m theta^{order + 1} dt; 0.4 in paper 002)"
    )
    own = "" if estimator.derivatives == "own" or switched < _SMALL_CHATTER else "; take the agents' own derivatives"
    return [Finding("REDCHO", "note", says + own)]


def not_rigid(why: str) -> Finding:
    """The framework has no stabilising stress."""
    return Finding("rigidity", "error", f"{why}; add edges, or move nodes off lines")


def localization_step(world: World, estimator: JacobiOverRelaxation) -> Finding:
    """How fast localization comes to its answer, from measurements as they would be without noise."""
    if not world.sensor.says_positions:
        says = "agents find out where they are from positions of each other, and the sensor says directions alone"
        return Finding("localization", "error", says)
    known = FirstMeasurements(world.links, world.sensor, (), world.formation.dimension)
    known.take(sensors.relative(world.formation.nominal, world.links), np.ones(len(world.links), dtype=bool))
    edges, leaders = known.edges(), world.formation.leaders
    if estimator.anchor and len(leaders) != 1:
        says = f"with an anchor exactly one agent leads: formation.leaders has {len(leaders)}"
        return Finding("localization", "error", says)
    anchor = leaders[0] if len(leaders) == 1 else 1
    found = localization.rates(edges, estimator.h, anchor=anchor - 1)
    says = (
        f"rate {found.anchor if estimator.anchor else found.centroid:.4f} a tick with h {estimator.h:g} (weighted centroid "
        f"{found.centroid:.4f}, agent {anchor} as the anchor {found.anchor:.4f}); "
        f"h {localization.step(edges, 'smooth'):.3f} is the fastest without ringing, "
        f"{localization.step(edges, 'fast'):.3f} of all"
    )
    return Finding("localization", "ok", says)


def closed_loop(formation: Formation, L: Array, law: Any, estimator: Any, dt: float) -> list[Finding]:
    """Whether stress, gains and step hold the formation."""
    followers = ~formation.is_leader
    L_ff = L[np.ix_(followers, followers)]
    spectrum = np.linalg.eigvalsh(L)
    nonzero = spectrum[formation.dimension + 1 :]
    slow, fast = np.linalg.eigvalsh(L_ff)[[0, -1]]
    found = [
        Finding("rigidity", "ok", f"universally rigid: stress eigenvalues {nonzero[0]:.4f} to {nonzero[-1]:.4f}"),
        Finding("followers", "ok", f"follower block eigenvalues {slow:.4f} to {fast:.4f}"),
    ]
    degree = np.diag(L)[followers]
    if isinstance(law, VaryingVelocity) and law.source == "feed-forward":
        found.append(Finding("one-tick radius", "ok", "velocities are fed forward: no loop through the network"))
    elif isinstance(law, VaryingVelocity | DoubleVaryingVelocity):
        found.append(_one_tick(law, L_ff, degree, dt))
    step = stability.step_matrix(law, L_ff, degree, dt)
    if step is None:
        found.append(Finding("step", "note", f"{type(law).__name__} is not a law of Table II; its step is not checked"))
    else:
        found.append(_step(stability.radius(step), law, dt, fast))
    if isinstance(estimator, ConsensusLocalization) or (
        isinstance(estimator, GeometryAwareFilter) and estimator.geometry == "conral"
    ):
        found.append(_consensus(formation, estimator.epsilon))
    return found


def timeline(faults: Sequence[Fault], ticks: int, dt: float) -> list[Finding]:
    """Faults that the run is too short for."""
    return [
        Finding(
            "timeline",
            "note",
            f"'{fault.describe()}' at {fault.start * dt:g} s lies beyond the end of the run",
        )
        for fault in faults
        if fault.trigger is None and fault.start >= ticks
    ]


def _connected(formation: Formation) -> Finding:
    B = stress.incidence(formation.agents, formation.edges)
    with_first = reached((B @ B.T) != 0.0)[0]
    if with_first.all():
        edges = len(formation.edges)
        return Finding("graph", "ok", f"{formation.agents} agents, {edges} undirected edges, connected")
    apart = (np.flatnonzero(~with_first) + 1).tolist()
    return Finding("graph", "error", f"the graph is disconnected: agents {apart} cannot be reached from agent 1")


def _edges(formation: Formation) -> Finding:
    loops = [f"{i}-{j}" for i, j in formation.edges if i == j]
    pairs = [tuple(sorted(edge)) for edge in formation.edges]
    doubled = sorted({f"{i}-{j}" for i, j in pairs if pairs.count((i, j)) > 1})
    if loops or doubled:
        return Finding("edges", "error", f"every edge joins two agents, once; look at {', '.join(loops + doubled)}")
    return Finding("edges", "ok", "every edge joins two agents, once")


def leaders(formation: Formation) -> Finding:
    """Whether the leaders can carry an affine formation."""
    dimension = formation.dimension
    rows = np.array(sorted(set(formation.leaders)), dtype=np.int64) - 1
    spread = formation.nominal[rows] - formation.nominal[rows].mean(axis=0) if len(rows) else np.zeros((0, dimension))
    rank = np.linalg.matrix_rank(spread) if len(rows) else 0
    if rank < dimension:
        return Finding(
            "leaders",
            "error",
            f"leaders {[*formation.leaders]} do not span: an affine map of {dimension} dimensions needs "
            f"{dimension + 1} leaders that lie on no common {'line' if dimension == 2 else 'plane'}",
        )
    if len(rows) == formation.agents:
        return Finding("leaders", "error", "every agent is a leader: nobody is left to follow")
    return Finding(
        "leaders",
        "ok",
        f"leaders {[*formation.leaders]} span the plane" if dimension == 2 else "leaders span",
    )


def _one_tick(law: VaryingVelocity | DoubleVaryingVelocity, L_ff: Array, degree: Array, dt: float) -> Finding:
    name, what = "one-tick radius", ("velocities", "accelerations")[law.order - 1]
    radius = stability.one_tick_radius(L_ff, degree, law.relaxation)
    if radius < 1.0:
        return Finding(name, "ok", f"{radius:.3f} < 1: {what} heard one tick late settle")
    remedy = _relaxation_that_settles(law, L_ff, degree, dt)
    relax = f"relax the law (relaxation = {remedy:.2f} settles), " if remedy else ""
    other = ", or feed velocities forward" if isinstance(law, VaryingVelocity) else ""
    return Finding(
        name,
        "error",
        f"{radius:.3f} >= 1: {what} heard one tick late diverge; {relax}choose other leaders{other}",
    )


def _relaxation_that_settles(
    law: VaryingVelocity | DoubleVaryingVelocity, L_ff: Array, degree: Array, dt: float
) -> float | None:
    for relaxation in np.arange(0.95, 0.0, -0.05).tolist():
        step = stability.step_matrix(replace(law, relaxation=relaxation), L_ff, degree, dt)
        if step is not None and stability.radius(step) < 1.0:
            return float(relaxation)
    return None


def _step(radius: float, law: Any, dt: float, fast: float) -> Finding:
    gain = getattr(law, "alpha", None)
    if radius < 1.0:
        gains = f", gain {gain:g}" if gain else ""
        settles = f"settles to 1/e in {_settle(radius, dt)}"
        return Finding("step", "ok", f"radius {radius:.6f} < 1 at dt {dt:g} s{gains}: {settles}")
    return Finding(
        "step",
        "error",
        f"radius {radius:.4f} >= 1 at dt {dt:g} s: the step is too long for the gains"
        f"{f' (dt * gain * eigenvalue = {dt * gain * fast:.3f})' if gain else ''}; lower the gains, or dt",
    )


def _settle(radius: float, dt: float) -> str:
    return f"{-dt / np.log(radius):.2f} s" if radius > 0.0 else "one tick"


def _consensus(formation: Formation, epsilon: float) -> Finding:
    B = stress.incidence(formation.agents, formation.edges)
    laplacian = B @ B.T
    bound = 2.0 / (np.linalg.eigvalsh(laplacian)[-1] + np.diag(laplacian).max() + 1.0)
    if epsilon <= 0.0:
        return Finding(
            "consensus", "error", f"epsilon {epsilon:g}: nothing is agreed on; give one above 0, below {bound:.4f}"
        )
    if epsilon < bound:
        return Finding("consensus", "ok", f"epsilon {epsilon:g} is below the bound {bound:.4f} of (14) on this graph")
    return Finding(
        "consensus",
        "error",
        f"epsilon {epsilon:g} is not below the bound {bound:.4f}: the consensus (14) diverges",
    )
