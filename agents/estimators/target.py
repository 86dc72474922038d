"""Where a target is that is found with a latency: DOE and SOE, fused by REDCHO (paper 002, sections 3 and 4).

Every axis is a filter of its own, with one covariance for all. Between detections the optimal estimate is predicted, and jumps
when one is done (DOE); the smooth one passes from the last prediction to this one in between (SOE). A spline through the
estimates and a low-pass filter are smooth too (remark 3). What is exchanged is information: consensus on it and its derivatives
gives all agents one estimate; or each takes the mean of what it hears.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from agents.algebra import missed_ticks, smoothing, starts
from agents.algebra.prediction import Prediction, detected, predicted
from agents.algebra.redcho import Consensus
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate, no_edges
from agents.estimators.base import Estimator
from agents.exchange import Channels, Field, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models.algebra import sum_over
from analysis.models.arrays import Array, Integers, Mask, chosen
from analysis.models.finding import Finding
from analysis.models.information import numbers, packed, position_jet, unpacked
from analysis.models.pursuit import Sighting, Target
from analysis.models.unsuited import Unsuited
from netem.core.channels import TARGET

_SUREST, _LEAST_SURE = 1e-3, 1e3  # standard deviations whose information can be inverted side by side
_SHORTEST, _LONGEST = 1e-3, 1e3  # lags, in seconds
_MOST = 0.5  # of the detections of the target
_LEAST = 0.01  # of one's own information: no mean over fewer than a hundred agents is smaller


class Track(NamedTuple):
    """What an agent remembers.

    Parameters
    ----------
    now
        What its clock said last, shape (...), in ticks; -1 before it has said anything.
    last, before
        The last two optimal estimates.
    settled
        Whether there are two, shape (...).
    method
        Of detection, now at work, shape (...).
    internal
        Variables of REDCHO, shape (..., m + 1, C), for the C different numbers of information matrix and vectors.
    theirs, silent
        What neighbours said last, shape (..., n, C), and for how many ticks they have not been heard, shape (..., n).
    stages
        Of the low-pass filter, shape (..., m + 1, C); (..., 0, C) with other outputs.
    """

    now: Integers
    last: Prediction
    before: Prediction
    settled: Mask
    method: Integers
    internal: Array
    theirs: Array
    silent: Integers
    stages: Array


@dataclass(frozen=True)
class TargetEstimator(Estimator[Track]):
    """An estimate of the target and its derivatives, by itself or with the neighbours.

    Parameters
    ----------
    output
        "smooth" (SOE), or "optimal" (DOE), which jumps; or what remark 3 holds against SOE: "spline", a polynomial from the
        estimate before to the last, which comes there when the next is due, or "low-pass", the optimal one filtered.
    alpha
        Of the transition function (appendix B) of SOE: the smaller, the sooner the newer prediction counts.
    fusion
        What becomes of information: all agents agree on their mean (REDCHO); each takes the mean of its own and that of the
        neighbours it hears ("mean", which is (8) where everybody hears everybody); or each keeps to its own ("none"). The
        former two want an output that is smooth.
    derivatives
        Whose derivatives go with the position found together: those found together too (Algorithm 1), or the agent's own. Those
        of REDCHO want far shorter ticks than networks have (docs/studies.md).
    theta
        Gain of REDCHO (14), per second.
    k
        Its gains without a unit, one for each derivative from 0 to m.
    gamma
        Its gains on the internal variables, per second, one for each derivative from 0 to m.
    hold
        For how long REDCHO counts a neighbour that it does not hear with what that said last, in ticks.
    prior_position
        Standard deviation of the target's position in tick 0, in metres.
    prior_derivatives
        Of each of its derivatives in tick 0, in metres per second and so on.
    lag
        Of the low-pass filter: the time constant of each of its m + 1 equal stages, in seconds.
    gate
        By how many standard deviations a detection may be off what was expected and still be of the target; 0 counts all.
    first
        Where each agent takes the target to be in tick 0, in metres; none, at the origin.
    internal
        v(0), the variables of REDCHO (14) of each agent in tick 0: m + 1 rows of the different numbers of information matrix
        and vectors; none, 0, which begin agreed on the mean.
    """

    output: Literal["smooth", "optimal", "spline", "low-pass"] = "smooth"
    alpha: float = 1.0
    fusion: Literal["redcho", "mean", "none"] = "redcho"
    derivatives: Literal["agreed", "own"] = "agreed"
    theta: float = 16.0
    k: Sequence[float] = (6.0, 11.0, 6.0)
    gamma: Sequence[float] = (1.0, 1.0, 1.0)
    hold: int = 10
    prior_position: float = 1.0
    prior_derivatives: float = 1.0
    lag: float = 0.05
    gate: float = 0.0
    first: Sequence[Sequence[float]] = ()
    internal: Sequence[Sequence[Sequence[float]]] = ()

    def __post_init__(self) -> None:
        if self.fusion != "none" and self.output == "optimal":
            raise ValueError(
                f"an output that jumps has no derivatives to fuse: fusion = {self.fusion!r} wants output = 'smooth'"
            )
        if self.alpha <= 0.0:
            raise ValueError(f"alpha must be above 0, not {self.alpha}")
        if not _SHORTEST <= self.lag <= _LONGEST:
            raise ValueError(f"lag is from {_SHORTEST:g} to {_LONGEST:g} s, not {self.lag:g}")
        if min(self.theta, *self.k, *self.gamma) <= 0.0:
            raise ValueError(f"REDCHO's gains must be above 0: theta {self.theta}, k {self.k}, gamma {self.gamma}")
        if self.gate < 0.0:
            raise ValueError(f"gate is a number of standard deviations, or 0, not {self.gate:g}")
        if self.hold < 0:
            raise ValueError(f"hold is a number of ticks, not {self.hold}")
        for name in ("prior_position", "prior_derivatives"):
            if not _SUREST <= getattr(self, name) <= _LEAST_SURE:
                raise ValueError(f"{name} is from {_SUREST:g} to {_LEAST_SURE:g}, not {getattr(self, name):g}")

    def channels(self, brief: Brief) -> Channels:
        """The information: as agreed on so far, or one's own with its derivatives."""
        order = _target(brief).order
        different = numbers(order, brief.dimension)
        match self.fusion:
            case "redcho":
                return {TARGET: {"information": Field((different,))}}
            case "mean":
                return {TARGET: {"information": Field((order + 1, different))}}
            case "none":
                return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Track:
        """In tick 0 the target was at rest, as far as is known, where the agent takes it to be."""
        order = _target(brief).order
        if self.fusion == "redcho" and not len(self.k) == len(self.gamma) == order + 1:
            raise Unsuited(f"a target of order {order} needs {order + 1} gains k and gamma")
        deviations = np.array([self.prior_position] + [self.prior_derivatives] * (order - 1))
        prior = np.broadcast_to(np.diag(deviations * deviations), (*batch, order, order)).copy()
        mean = np.zeros((*batch, order, brief.dimension))
        mean[..., 0, :] = starts.own(self.first, brief.number, (brief.dimension,))
        first = Prediction(mean, prior, np.zeros(batch, dtype=np.int64))
        slots, different = brief.present.shape[-1], numbers(order, brief.dimension)
        internal = np.zeros((*batch, order + 1, different))
        internal += starts.own(self.internal, brief.number, internal.shape[-2:])
        entering = packed(*predicted(_target(brief), first, first.made, brief.dt))[0]
        stages = order + 1 if self.output == "low-pass" else 0
        return Track(
            now=np.full(batch, -1, dtype=np.int64),
            last=first,
            before=first,
            settled=np.zeros(batch, dtype=bool),
            method=np.zeros(batch, dtype=np.int64),
            internal=internal,
            theirs=np.zeros((*batch, slots, different)),
            silent=np.full((*batch, slots), self.hold, dtype=np.int64),
            stages=np.broadcast_to(entering[..., None, :], (*batch, stages, different)).copy(),
        )

    def missed(self, brief: Brief, state: Track, gap: Gap) -> Track:
        """REDCHO and the lags go on, tick after tick; what was known last is carried on from when it was known."""
        lived = np.minimum(gap.ticks, missed_ticks.LONGEST)
        state = state._replace(now=state.now + gap.ticks - lived)
        if self.fusion != "redcho" and self.output != "low-pass":
            return state._replace(now=state.now + lived)

        def live(track: Track, _: int) -> Track:
            track = self._lagging(brief, track)._replace(now=track.now + 1)
            if self.fusion != "redcho":
                return track
            silence = Heard({"information": track.theirs}, np.zeros(track.theirs.shape[:-1], dtype=bool))
            return self._fused(brief, track, packed(*self._information(brief, track)), {TARGET: silence})[0]

        return missed_ticks.lived(state, lived, live, fresh=lambda: self.init(brief, gap.ticks.shape))

    def sense(
        self,
        brief: Brief,
        state: Track,
        measured: Array,  # noqa: ARG002
        seen: Mask,  # noqa: ARG002
    ) -> tuple[Track, Mapping[str, Fields]]:
        """A tick has passed; tell the information."""
        state = self._lagging(brief, state)._replace(now=state.now + 1)
        if self.fusion == "none":
            return state, {}
        own = packed(*self._information(brief, state))
        told = np.moveaxis(own, 0, -2) if self.fusion == "mean" else self._consensus.outputs(own, state.internal)[0]
        return state, {TARGET: {"information": told}}

    def fuse(self, brief: Brief, state: Track, heard: Mapping[str, Heard], own: Own) -> tuple[Track, Estimate]:
        """Take in a detection that is done; put together what is known."""
        state = state._replace(now=np.broadcast_to(np.asarray(own.tick, dtype=np.int64), state.now.shape))
        state = self._detected(brief, state, own)
        Q, y = self._information(brief, state)
        alone, local = packed(Q, y), position_jet(Q, y)
        fused, together, shared = alone, local, Q
        if self.fusion != "none":
            state, fused = self._fused(brief, state, alone, heard)
            shared, vectors = unpacked(fused, brief.dimension, _target(brief).order)
            # While agreement is far off, what is agreed on need not be the information of anything, or of next to nothing.
            sound = (np.linalg.eigvalsh(shared[0] - _LEAST * Q[0])[..., 0] > 0.0)[..., None, None]
            shared, vectors = np.where(sound, shared, Q), np.where(sound, vectors, y)
            together = position_jet(shared, vectors)
        reference = together if self.derivatives == "agreed" else np.concatenate([together[:1], local[1:]])
        reports = {
            "sighting": _sighted(own.sighting, local[0]),
            "reference": np.moveaxis(reference, 0, -2),
            "found": local[0],
            "variance": np.linalg.inv(shared[0])[..., 0, 0],
            "information": np.moveaxis(alone, 0, -2),
            "fused": np.moveaxis(fused, 0, -2),
        }
        return state, no_edges(brief.present, brief.dimension, reports)

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether information is heard in time, and how REDCHO comes along with the tick."""
        different = numbers(len(self.k) - 1, swarm.dimension)
        found = starts.suits("first", self.first, swarm.agents, (swarm.dimension,))
        found += starts.suits("internal", self.internal, swarm.agents, (len(self.k), different))
        if swarm.late and self.fusion != "none":
            says = (
                f"information is heard late ({', '.join(map(str, swarm.late))}), and taken for that of this tick: the target "
                "is put where it was"
            )
            found.append(Finding("information", "note", says))
        if self.fusion == "redcho":
            found += self._consensus.findings(swarm.dt, aided=self.derivatives == "own")
        if self.gate > 0.0 and (share := _through(self.gate, swarm.dimension)) < _MOST:
            says = f"gate = {self.gate:g} lets {share:.2g} of the detections of the target through, and turns the others away"
            found.append(Finding("detections", "note", f"{says}; 3 to 5 standard deviations are usual"))
        return found

    def _fused(self, brief: Brief, state: Track, own: Array, heard: Mapping[str, Heard]) -> tuple[Track, Array]:
        """The information found together, jets (m + 1, ..., C) like the agent's own."""
        said = heard[TARGET]
        fresh, theirs = said.fresh, said.fields["information"]
        if self.fusion == "mean":
            counted = sum_over(np.where(fresh[..., None, None], theirs, 0.0), -3)
            return state, (own + np.moveaxis(counted, -2, 0)) / (1 + fresh.sum(axis=-1))[..., None]
        consensus = self._consensus
        agreed = consensus.outputs(own, state.internal)
        # Both ends of an edge have to pull alike, or the mean drifts: what was said last counts for a while.
        held, silent = np.where(fresh[..., None], theirs, state.theirs), np.where(fresh, 0, state.silent + 1)
        counted = np.where((silent <= self.hold)[..., None], held, agreed[0][..., None, :])
        internal = consensus.step(state.internal, agreed[0], counted, brief.dt)
        return state._replace(internal=internal, theirs=held, silent=silent), agreed

    def _detected(self, brief: Brief, state: Track, own: Own) -> Track:
        """What is known in the tick in which a detection was done, where one was."""
        if own.sighting is None:
            raise Unsuited("this estimator needs a target: give the scenario a [target]")
        done = own.sighting.done
        taken = detected(_target(brief), state.last, state.now, own.sighting, self.gate, brief.dt)
        last, before = chosen(done, taken, state.last), chosen(done, state.last, state.before)
        return state._replace(last=last, before=before, settled=state.settled | done, method=own.sighting.method)

    def _lagging(self, brief: Brief, state: Track) -> Track:
        """A tick passes in the low-pass filter, with the optimal information as it was."""
        if self.output != "low-pass":
            return state
        entering = packed(*predicted(_target(brief), state.last, state.now, brief.dt))[0]
        return state._replace(stages=smoothing.lagging(state.stages, entering, brief.dt / self.lag))

    def _information(self, brief: Brief, state: Track) -> tuple[Array, Array]:
        """Jets of information matrix (m + 1, ..., m, m) and vectors (m + 1, ..., m, D)."""
        target = _target(brief)
        if self.output == "optimal":
            return predicted(target, state.last, state.now, brief.dt)
        if self.output == "low-pass":
            leaving = smoothing.last_of(state.stages, 1.0 / self.lag)
            return unpacked(leaving, brief.dimension, target.order)
        both = Prediction(*(np.stack(pair) for pair in zip(state.before, state.last, strict=True)))
        if self.output == "smooth":
            share = self._share(target, state, brief.dt)
            Q, y = (smoothing.mixed(*_pair(jet), share) for jet in predicted(target, both, state.now, brief.dt))
        else:
            by = smoothing.counts(*_passed(target, state, brief.dt), target.order)
            Q, y = (smoothing.splined(*_pair(jet), by) for jet in predicted(target, both, both.made, brief.dt))
        return Q, y

    def _share(self, target: Target, state: Track, dt: float) -> Array:
        """The jet of eta, shape (m + 1, ...); all of the only estimate there is, before the first detection."""
        passed, seconds = _passed(target, state, dt)
        share = smoothing.passed_over(passed, 1.0 / seconds, self.alpha, target.order)
        alone = np.concatenate([np.ones((1, *passed.shape)), np.zeros((target.order, *passed.shape))])
        return np.where(state.settled, share, alone)

    @cached_property
    def _consensus(self) -> Consensus:
        return Consensus(len(self.k) - 1, self.theta, tuple(self.k), tuple(self.gamma))


def _through(gate: float, dimension: int) -> float:
    """The share of detections of the target that are off what is expected by no more than so many standard deviations."""
    from scipy.special import chdtr  # only who checks needs it

    return float(chdtr(dimension, gate * gate))


def _target(brief: Brief) -> Target:
    if brief.target is None:
        raise Unsuited("this estimator needs a target: give the scenario a [target]")
    return brief.target


def _pair(of_both: Array) -> tuple[Array, Array]:
    """The jets of the older and of the newer prediction, of those of both (m + 1, 2, ...)."""
    return of_both[:, 0], of_both[:, 1]


def _passed(target: Target, state: Track, dt: float) -> tuple[Array, Array]:
    """How much of its latency the detection at work has taken, and that latency in seconds, both (...)."""
    seconds = np.asarray(target.latencies[state.method] * dt, dtype=np.float64)
    return np.clip((state.now - state.last.made) * dt / seconds, 0.0, 1.0), seconds


def _sighted(sighting: Sighting | None, like: Array) -> Array:
    """Where a detection that is done in this tick puts the target, in the shape of another position; NaN otherwise."""
    if sighting is None:
        return np.full_like(like, np.nan)
    return np.where(sighting.done[..., None], sighting.position, np.nan)
