"""What is checked before anything starts, in plain words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from typing import Any, Literal

import numpy as np

from affinet.scenario.target import TargetSection
from agents.algebra import stability
from agents.loading import capabilities
from agents.swarm import SwarmBrief
from analysis.models.arrays import Array
from analysis.models.finding import Finding
from analysis.models.graph import reached
from netem.core.listing import listed
from netem.faults.fault import Fault
from world.formation import manoeuvre as manoeuvres
from world.formation import stress
from world.formation.nominal import Formation

_NARROW = 0.7  # a quarter turn by the entries of theta gets no narrower
_ROUNDING = 1e-6
_BALANCED = 1e-6  # of what a follower's weights pull with
_POSITIVE = 1e-9  # of the largest


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


def not_rigid(why: str) -> Finding:
    """The framework has no stabilising stress."""
    return Finding("rigidity", "error", f"{why}; add edges, or move nodes off lines")


def rigid(formation: Formation, L: Array) -> list[Finding]:
    """What the stress matrix L, shape (N, N), says of a framework that has one."""
    spectrum = np.linalg.eigvalsh(L)
    nonzero = spectrum[formation.dimension + 1 :]
    followers = ~formation.is_leader
    slow, fast = np.linalg.eigvalsh(L[np.ix_(followers, followers)])[[0, -1]]
    return [
        Finding("rigidity", "ok", f"universally rigid: stress eigenvalues {nonzero[0]:.4f} to {nonzero[-1]:.4f}"),
        Finding("followers", "ok", f"follower block eigenvalues {slow:.4f} to {fast:.4f}"),
    ]


def own_weights(formation: Formation, L: Array) -> list[Finding]:
    """Whether weights of a user's own, in the stress matrix L, shape (N, N), hold the followers in their places.

    Those of a follower balance where it stands, and sum to something positive, by which laws divide; the eigenvalues of the
    followers' block have positive real parts. Rows of L sum to zero by how it is made; those of leaders are nothing to a law.
    """
    followers = np.flatnonzero(~formation.is_leader)
    rows = L[followers]
    off = np.abs(rows @ formation.nominal).max(axis=1)
    apart = np.abs(formation.nominal[followers][:, None] - formation.nominal).max(axis=-1)
    unbalanced = off > _BALANCED * (np.abs(rows) * apart).sum(axis=1)
    if unbalanced.any():
        agents, by = followers[unbalanced] + 1, off[unbalanced][0]
        says = f"the weights of agent {listed(agents, most=1)} do not balance: sum l_ij p_ij is {by:.3g} m off"
        return [Finding("weights", "error", f"{says}; give more digits, or other weights")]
    idle = followers[np.diag(L)[followers] <= 0.0] + 1
    if len(idle):
        says = f"the weights of agent {listed(idle, most=1)} do not sum to more than 0, and laws divide by their sum"
        return [Finding("weights", "error", f"{says}; give all of its weights the other sign")]
    real = np.sort(np.linalg.eigvals(rows[:, followers]).real)
    if real[0] <= _POSITIVE * real[-1]:
        says = f"follower block has an eigenvalue with a real part of {real[0]:.4g}, not above 0: it does not settle"
        return [Finding("weights", "error", f"{says}; give other weights, or other leaders")]
    kind = "alike both ways" if (L == L.T).all() else "not alike both ways"
    return [
        Finding("weights", "ok", f"of its own, {kind}: followers balance where they stand"),
        Finding("followers", "ok", f"follower block eigenvalues {real[0]:.4f} to {real[-1]:.4f}"),
    ]


def step(law: Any, swarm: SwarmBrief) -> Finding:
    """Whether the gains of a law, and the step, hold the formation, as far as it says what they make of it."""
    matrix, dt = capabilities.step_matrix(law, swarm), swarm.dt
    if matrix is None:
        return Finding(
            "step",
            "note",
            f"{type(law).__name__} brings no step_matrix (docs/laws.md): whether it settles with this step is not known",
        )
    radius, gain = stability.radius(matrix), capabilities.step_gain(law)
    if radius < 1.0:
        gains = f", gain {gain:g}" if gain else ""
        settles = stability.settling_time(radius, dt)
        return Finding("step", "ok", f"radius {radius:.6f} < 1 at dt {dt:g} s{gains}: {settles}")
    fast = stability.radius(swarm.follower_stress)
    return Finding(
        "step",
        "error",
        f"radius {radius:.4f} >= 1 at dt {dt:g} s: the step is too long for the gains"
        f"{f' (dt * gain * eigenvalue = {dt * gain * fast:.3f})' if gain else ''}; lower the gains, or dt",
    )


def timeline(faults: Sequence[Fault], ticks: int, dt: float) -> list[Finding]:
    """Faults that the run is too short for."""
    return [
        Finding(
            "timeline",
            "note",
            f"'{fault.describe()}' starts at {fault.start * dt:g} s, and the run ends at {ticks * dt:g} s: it will touch "
            "nothing, and the run will be vacuous",
        )
        for fault in faults
        if fault.trigger is None and fault.start >= ticks
    ]


def detections(target: TargetSection, seconds: float) -> list[Finding]:
    """Detectors that find nothing in a run of so many seconds."""
    if target.misses == 1.0:
        says = "target.misses = 1: no detection ever finds the target, and all that is known of it is what was known at first"
        return [Finding("detections", "note", says)]
    late = [f"{latency:g}" for latency in target.latencies if latency >= seconds]
    if late:
        says = f"a detection that takes {' or '.join(late)} s (target.latencies) is not done in a run of {seconds:g} s"
        return [Finding("detections", "note", says)]
    return []


def _connected(formation: Formation) -> Finding:
    B = stress.incidence(formation.agents, formation.edges)
    laplacian = B @ B.T
    with_first = reached(laplacian != 0.0)[0]
    if with_first.all():
        edges, connectivity = len(formation.edges), np.linalg.eigvalsh(laplacian)[1]
        says = f"{formation.agents} agents, {edges} undirected edges, algebraic connectivity {connectivity:.3f}"
        return Finding("graph", "ok", says)
    apart = (np.flatnonzero(~with_first) + 1).tolist()
    return Finding("graph", "error", f"the graph is disconnected: agents {apart} cannot be reached from agent 1")


def _edges(formation: Formation) -> Finding:
    loops = [f"{i}-{j}" for i, j in formation.edges if i == j]
    times = Counter(tuple(sorted(edge)) for edge in formation.edges)
    doubled = sorted(f"{i}-{j}" for (i, j), often in times.items() if often > 1)
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
