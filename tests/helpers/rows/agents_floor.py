"""`agents`: what estimators and laws are made of. They themselves fly in test_bits.py."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
from briefs import BRIEF, of_all

from agents import estimate
from agents.algebra import (
    blocks,
    completion,
    constraints,
    geometry,
    kalman,
    late_news,
    missed_ticks,
    prediction,
    redcho,
    smoothing,
    starts,
)
from agents.algebra.geometry import Fit
from agents.algebra.prediction import Prediction
from agents.algebra.unknowns import Belief, EdgeModel
from agents.centre.checked import CheckedCentre
from agents.estimate import Estimate
from agents.estimators import edge_kf, joint_kf, ral
from agents.estimators.centralized import SwarmFilter, Whole
from agents.estimators.conral import Indicator
from agents.estimators.rkf import EdgeFilters, Tracks
from agents.exchange import Heard
from agents.laws import base, leaders
from analysis.models.affine import Manoeuvre
from analysis.models.pursuit import Sighting, Target
from analysis.models.sensor import Sensor
from rows.case import covariance, of, real, share, truth, whole
from world.formation.nominal import Formation

NEIGHBOURS = 9  # sums of more than eight numbers take another path
MAPS = {
    "affine": constraints.Affine(),
    "scaling": constraints.Scaling(),
    "rotation": constraints.Rotation(),
    "similarity": constraints.Similarity(),
}
TARGET = Target(3, 0.7, np.array([3, 5]), np.array([0.1, 0.2]))
CONSENSUS = redcho.Consensus(3, 14.0, (6.0, 11.0, 6.0, 1.0), (1.0, 2.0, 1.5, 1.0))
MANOEUVRE = Manoeuvre(*(np.random.default_rng(6).normal(size=(20, *size)) for size in ((2, 2), (2,))))
OFFSETS = np.random.default_rng(5).normal(size=(9, 2)).tolist()
NOISE = np.array([[0.02, 0.01], [0.01, 0.03]])
FIVE = Formation(np.random.default_rng(8).normal(size=(5, 2)), tuple(combinations(range(1, 6), 2)), ())
CENTRE = SwarmFilter(
    of_all(FIVE, dt=0.013, sensor=Sensor("coordinates", NOISE), displacement=0.1 * np.eye(2), persistence=0.6),
    prior_position=1.0,
)
FILTERS = EdgeFilters()
MODEL = EdgeModel(0.013, (0.5, -0.3), 0.2, 0.6)
REMEMBERED = (
    real(3, 2),
    real(3, 2),
    real(3, NEIGHBOURS, 2),
    truth(3, NEIGHBOURS),
    real(3, NEIGHBOURS, 2),
    truth(3, NEIGHBOURS),
    whole(4),
)
F, Q = kalman.motion("constant-velocity", 0.013, 0.7)


def _brief(**held):
    return SimpleNamespace(dt=0.013, **held)


def _remembered(given):
    before, *taken_in, lived = given[:7]
    return late_news.RecentTicks(Belief(before, 2.0 * before), late_news.TakenIn(*taken_in), lived)


def _lived(belief, gone):
    return Belief(belief.mean + 0.3 * belief.covariance, belief.covariance * (0.7 + gone))


def _step(before, tick):
    return Belief(before.mean + tick.own, before.covariance * tick.own), tick.known


def _estimate(relative, known, spread=None):
    return Estimate(relative, known, spread, None)


def _fit(theta, gram, feasible=True):
    return Fit(theta, np.broadcast_to(feasible, theta.shape[:-2]), gram)


def _covariances(maps, dimension):
    R = NOISE if dimension == 2 else np.diag([0.1, 0.2, 0.3])
    return lambda relative, measured, seen: maps.covariance(maps.fit(relative, measured, seen), relative, R)


def _completed(relative, known, measured, seen, theta, spread):
    perceived = ral.Perceived(measured, seen, _fit(theta, spread[..., 0, :, :]))
    brief = _brief(relative=relative, present=known, sensor=SimpleNamespace(common=NOISE))
    return ral.complete(brief, perceived, perceived.local, spread, np.full(theta.shape[:-2], np.nan))


CASES = {
    "agents.brief.Brief.degree": of(lambda stress: replace(BRIEF, stress=stress).degree, real(NEIGHBOURS)),
    **{
        name: of(
            lambda position, pushed, spread, *heard, centre=centre: centre.step(
                Whole(position, pushed, spread), *heard
            ),
            *(real(5, 2), real(5, 2), covariance(20, 20), real(5, 4, 2), truth(5, 4), real(5, 2)),
        )
        for name, centre in (
            ("agents.estimators.centralized.SwarmFilter.step", CENTRE),
            ("agents.centre.checked.CheckedCentre.step", CheckedCentre(CENTRE, CENTRE.swarm)),
        )
    },
    "agents.laws.base.weighted": of(base.weighted, real(NEIGHBOURS), real(NEIGHBOURS, 2)),
    "agents.laws.base.by_degree": of(base.by_degree, real(2), real()),
    "agents.laws.base.stress_force": of(
        lambda stress, relative, known: base.stress_force(_brief(stress=stress), _estimate(relative, known)),
        *(real(NEIGHBOURS), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.laws.leaders.hold_distances": of(
        lambda p, leads, relative, known: leaders.hold_distances(
            _brief(relative=p, leads=leads), 0.7, _estimate(relative, known)
        ),
        *(real(NEIGHBOURS, 2), truth(NEIGHBOURS), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.laws.leaders.pilot": of(
        lambda nominal, k, position: leaders.pilot(_brief(nominal=nominal), MANOEUVRE, 0.7, k, position),
        *(real(2), whole(20), real(2)),
    ),
    "agents.laws.leaders.pilot_of_accelerations": of(
        lambda nominal, k, position, velocity: leaders.pilot_of_accelerations(
            _brief(nominal=nominal), MANOEUVRE, 0.7, k, position, velocity
        ),
        *(real(2), whole(20), real(2), real(2)),
    ),
    "agents.laws.leaders.saturated": of(lambda command: leaders.saturated(command, 2.0), real(3), rows=300),
    "agents.estimate.Estimate.spread": of(
        lambda relative, known, spread: _estimate(relative, known, spread).spread,
        *(real(NEIGHBOURS, 3), truth(NEIGHBOURS), covariance(NEIGHBOURS, 3, 3)),
    ),
    "agents.estimate.no_edges": of(lambda slots: estimate.no_edges(slots, 2, {}), truth(NEIGHBOURS)),
    "agents.estimate.no_indicator": of(estimate.no_indicator, truth(NEIGHBOURS)),
    "agents.algebra.blocks.block_diagonal": of(blocks.block_diagonal, real(NEIGHBOURS, 2, 2)),
    "agents.algebra.blocks.diagonal_blocks": of(lambda matrix: blocks.diagonal_blocks(matrix, 2), real(18, 18)),
    "agents.estimators.edge_kf.of_edges": of(
        lambda process: edge_kf.of_edges(_brief(process=process, dimension=2)), real(18, 18)
    ),
    "agents.algebra.completion.completed": of(
        completion.completed, real(NEIGHBOURS), real(NEIGHBOURS, 2), truth(NEIGHBOURS, p=0.5)
    ),
    "agents.algebra.geometry.gram": of(geometry.gram, real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    "agents.algebra.geometry.cross": of(geometry.cross, real(NEIGHBOURS, 2), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    "agents.algebra.geometry.inverse_gram": of(geometry.inverse_gram, covariance(2, 2), truth()),
    "agents.algebra.geometry.indicator": of(
        lambda theta, gram, theirs, counts: geometry.indicator(_fit(theta, gram), theirs, counts),
        *(real(2, 2), covariance(2, 2), real(NEIGHBOURS, 2, 2), truth(NEIGHBOURS)),
    ),
    "agents.algebra.unknowns.EdgeModel.ahead": of(
        lambda mean, spread, pushed: MODEL.ahead(Belief(mean, spread), pushed),
        *(real(4, 2), covariance(8, 8), covariance(2, 2)),
    ),
    "agents.algebra.unknowns.EdgeModel.hear": of(
        lambda mean, spread, flown, known: MODEL.hear(Belief(mean, spread), flown, known),
        *(real(4, 2), covariance(8, 8), real(2), truth(2)),
    ),
    "agents.algebra.unknowns.EdgeModel.move": of(
        lambda mean, spread, own: MODEL.move(Belief(mean, spread), own),
        *(real(4, 2), covariance(8, 8), real(2)),
    ),
    "agents.algebra.unknowns.Belief.edges": of(
        lambda mean, spread: Belief(mean, spread).edges, real(5, 2), covariance(10, 10)
    ),
    "agents.algebra.unknowns.Belief.doubted": of(
        lambda mean, spread: Belief(mean, spread).doubted, real(5, 2), covariance(4, 4)
    ),
    "agents.algebra.unknowns.Belief.corrected": of(
        lambda mean, spread, doubted, left: Belief(mean, spread).corrected(doubted, left),
        *(real(5, 2), covariance(4, 4), real(4), covariance(4, 4)),
    ),
    "agents.algebra.unknowns.Belief.placed": of(
        lambda mean, spread, edges: Belief(mean, spread).placed(edges), real(5, 2), covariance(4, 4), real(2)
    ),
    "agents.algebra.late_news.advanced": of(
        lambda *given: late_news.advanced(_remembered(given), Belief(given[7], given[7]), *given[8:]),
        *(*REMEMBERED, real(2), real(2), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.algebra.late_news.filled_in": of(
        lambda *given: late_news.filled_in(_remembered(given), Heard({"velocity": given[7]}, *given[8:])),
        *(*REMEMBERED, real(NEIGHBOURS, 2), truth(NEIGHBOURS), whole(4, NEIGHBOURS)),
    ),
    "agents.algebra.late_news.reprocessed": of(
        lambda *given: late_news.reprocessed(_remembered(given), given[7], _step), *REMEMBERED, whole(3)
    ),
    "agents.algebra.late_news.unheard": of(
        lambda *given: late_news.unheard(_remembered(given), Belief(given[7], given[7]), given[8], _step),
        *(*REMEMBERED, real(2), real(2)),
    ),
    "agents.estimators.joint_kf.corrected": of(
        lambda mean, spread, *measured: joint_kf.corrected(Belief(mean, spread), *measured),
        *(real(3, 18), covariance(36, 36), real(18), covariance(18, 18), truth(NEIGHBOURS)),
    ),
    "agents.algebra.kalman.predict": of(
        lambda mean, spread: kalman.predict(mean, spread, F, Q), real(NEIGHBOURS, 4), covariance(NEIGHBOURS, 4, 4)
    ),
    "agents.algebra.kalman.coasted": of(
        lambda mean, spread, ticks: kalman.coasted(mean, spread, F, Q, ticks),
        *(real(NEIGHBOURS, 4), covariance(NEIGHBOURS, 4, 4), whole(9, NEIGHBOURS)),
    ),
    "agents.algebra.missed_ticks.lived": of(
        lambda mean, ticks: missed_ticks.lived(
            Belief(mean, 2.0 * mean), ticks, _lived, lambda: Belief(0.0 * mean, mean)
        ),
        *(real(4, 2), whole(9)),
    ),
    "agents.algebra.kalman.normalised": of(
        kalman.normalised, real(NEIGHBOURS, 2), covariance(NEIGHBOURS, 2, 2), truth(NEIGHBOURS)
    ),
    "agents.algebra.kalman.correct": of(
        lambda mean, spread, seen, usable: kalman.correct(mean, spread, seen, NOISE, usable),
        *(real(NEIGHBOURS, 4), covariance(NEIGHBOURS, 4, 4), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.algebra.kalman.tracked": of(
        lambda mean, spread, seen, usable: kalman.tracked(mean, spread, F, Q, seen, NOISE, usable),
        *(real(NEIGHBOURS, 4), covariance(NEIGHBOURS, 4, 4), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.algebra.prediction.carried": of(
        lambda mean, spread, s: prediction.carried(TARGET, Prediction(mean, spread, None), s),
        *(real(3, 2), covariance(3, 3), share()),
    ),
    "agents.algebra.prediction.detected": of(
        lambda mean, spread, made, now, where, done, method: prediction.detected(
            TARGET, Prediction(mean, spread, made), now + 50, Sighting(where, done, method, method), 2.0, 0.013
        ),
        *(real(3, 2), covariance(3, 3), whole(50), whole(99), real(2), truth(), whole(2)),
    ),
    "agents.algebra.smoothing.passed_over": of(
        lambda passed, seconds: smoothing.passed_over(passed, 1.0 / seconds, 0.3, 3), share(), share(), out=1
    ),
    "agents.algebra.smoothing.mixed": of(
        smoothing.mixed, real(4, 3, 2, axis=1), real(4, 3, 2, axis=1), real(4, axis=1), out=1
    ),
    "agents.algebra.smoothing.counts": of(
        lambda passed, seconds: smoothing.counts(passed, seconds, 3), share(), share(), out=2
    ),
    "agents.algebra.smoothing.splined": of(
        lambda older, newer, *way: smoothing.splined(older, newer, smoothing.counts(*way, 3)),
        *(real(4, 3, 2, axis=1), real(4, 3, 2, axis=1), share(), share()),
        out=1,
    ),
    "agents.algebra.smoothing.lagging": of(
        lambda stages, entering: smoothing.lagging(stages, entering, 0.26), real(4, 9), real(9)
    ),
    "agents.algebra.smoothing.last_of": of(lambda stages: smoothing.last_of(stages, 20.0), real(4, 9), out=1),
    "agents.algebra.prediction.predicted": of(
        lambda mean, spread, made, now: prediction.predicted(TARGET, Prediction(mean, spread, made), now, 0.013),
        *(real(3, 2), covariance(3, 3), whole(50), whole(99)),
        out=1,
    ),
    "agents.estimators.ral.complete": of(
        _completed,
        *(
            real(NEIGHBOURS, 2),
            truth(NEIGHBOURS),
            real(NEIGHBOURS, 2),
            truth(NEIGHBOURS),
            real(2, 2),
            covariance(NEIGHBOURS, 2, 2),
        ),
    ),
    "agents.estimators.conral.Indicator.psi": of(lambda heard, age: Indicator(heard, age).psi, real(), real()),
    "agents.estimators.rkf.EdgeFilters.ahead": of(
        lambda mean, spread, nis, known: FILTERS.ahead(BRIEF, Tracks(mean, spread, nis, known)),
        *(real(NEIGHBOURS, 6), covariance(NEIGHBOURS, 6, 6), real(NEIGHBOURS), truth(NEIGHBOURS)),
    ),
    "agents.estimators.rkf.EdgeFilters.coasted": of(
        lambda mean, spread, nis, known, ticks: FILTERS.coasted(BRIEF, Tracks(mean, spread, nis, known), ticks),
        *(real(NEIGHBOURS, 6), covariance(NEIGHBOURS, 6, 6), real(NEIGHBOURS), truth(NEIGHBOURS), whole(9)),
    ),
    "agents.estimators.rkf.EdgeFilters.estimate": of(
        lambda mean, spread, nis, known: FILTERS.estimate(BRIEF, Tracks(mean, spread, nis, known), known[..., 0]),
        *(real(NEIGHBOURS, 6), covariance(NEIGHBOURS, 6, 6), real(NEIGHBOURS), truth(NEIGHBOURS)),
    ),
    "agents.algebra.redcho.Consensus.outputs": of(CONSENSUS.outputs, real(4, 9, axis=1), real(4, 9), out=1),
    "agents.algebra.starts.own": of(
        lambda number: starts.own(OFFSETS, 1 + (number * 8).astype(int), (2,)), share(), rows=100
    ),
    "agents.algebra.redcho.Consensus.step": of(
        lambda internal, own, theirs: CONSENSUS.step(internal, own, theirs, 0.013),
        *(real(4, 9), real(9), real(NEIGHBOURS, 9)),
    ),
    **{
        f"agents.algebra.{what} ({dimension})": case
        for dimension in (2, 3)
        for what, case in {
            "geometry.regular": of(geometry.regular, covariance(dimension, dimension)),
            **{
                f"constraints.{type(maps).__name__}.{method}": of(call, *arguments)
                for maps in MAPS.values()
                for method, call, arguments in (
                    ("feasible", maps.feasible, (covariance(dimension, dimension),)),
                    ("nearest", maps.nearest, (real(dimension, dimension),)),
                    ("fit", maps.fit, (real(9, dimension), real(9, dimension), truth(9))),
                    (
                        "covariance",
                        _covariances(maps, dimension),
                        (real(9, dimension), real(9, dimension), truth(9)),
                    ),
                )
            },
        }.items()
    },
}
