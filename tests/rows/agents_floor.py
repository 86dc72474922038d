"""`agents`: what estimators and laws are made of. They themselves fly in test_bits.py."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from briefs import BRIEF

from agents import agent, controllers, second_order
from agents.centre import Centre, Whole
from agents.estimators import (
    base,
    blocks,
    constraints,
    edge_kf,
    geometry,
    inputs,
    joint_kf,
    kalman,
    prediction,
    ral,
    redcho,
    small,
)
from agents.estimators.base import Estimate, Heard
from agents.estimators.geometry import Fit
from agents.estimators.none import Measured
from agents.estimators.prediction import Prediction
from agents.estimators.rkf import EdgeFilters, Tracks
from analysis.affine import Manoeuvre
from analysis.pursuit import Target
from analysis.sensor import Sensor
from rows.case import covariance, of, real, share, truth, whole

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
NOISE = np.array([[0.02, 0.01], [0.01, 0.03]])
CENTRE = Centre(
    *(0.013, np.array([[j for j in range(5) if j != i] for i in range(5)]), np.ones((5, 4), dtype=bool)),
    *(Sensor("coordinates", NOISE), 0.1 * np.eye(10), 1.0),
)
FILTERS = EdgeFilters()
F, Q = kalman.motion("constant-velocity", 2, 0.013, 0.7)


def _brief(**held):
    return SimpleNamespace(dt=0.013, **held)


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
    "agents.agent.chosen": of(agent.chosen, truth(), real(9, 2), real(9, 2)),
    "agents.agent.renew": of(
        lambda new, one, other: agent.renew(Measured(one, one), Measured(other, one), new), truth(), real(9), real(9)
    ),
    "agents.brief.Brief.degree": of(lambda stress: replace(BRIEF, stress=stress).degree, real(NEIGHBOURS)),
    "agents.centre.Centre.step": of(
        lambda position, spread, measured, seen, flown: CENTRE.step(Whole(position, spread), measured, seen, flown),
        *(real(5, 2), covariance(10, 10), real(5, 4, 2), truth(5, 4), real(5, 2)),
    ),
    "agents.controllers.weighted": of(controllers.weighted, real(NEIGHBOURS), real(NEIGHBOURS, 2)),
    "agents.controllers.stress_force": of(
        lambda stress, relative, known: controllers.stress_force(_brief(stress=stress), _estimate(relative, known)),
        *(real(NEIGHBOURS), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.controllers.hold_distances": of(
        lambda p, leads, relative, known: controllers.hold_distances(
            _brief(relative=p, leads=leads), 0.7, _estimate(relative, known)
        ),
        *(real(NEIGHBOURS, 2), truth(NEIGHBOURS), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.controllers.pilot": of(
        lambda nominal, k, position: controllers.pilot(_brief(nominal=nominal), MANOEUVRE, 0.7, k, position),
        *(real(2), whole(20), real(2)),
    ),
    "agents.second_order.pilot": of(
        lambda nominal, k, position, velocity: second_order.pilot(
            _brief(nominal=nominal), MANOEUVRE, 0.7, k, position, velocity
        ),
        *(real(2), whole(20), real(2), real(2)),
    ),
    "agents.controllers.saturated": of(lambda command: controllers.saturated(command, 2.0), real(3), rows=300),
    "agents.estimators.base.Estimate.spread": of(
        lambda relative, known, spread: _estimate(relative, known, spread).spread,
        *(real(NEIGHBOURS, 3), truth(NEIGHBOURS), covariance(NEIGHBOURS, 3, 3)),
    ),
    "agents.estimators.base.no_edges": of(lambda slots: base.no_edges(slots, 2, {}), truth(NEIGHBOURS)),
    "agents.estimators.base.no_indicator": of(base.no_indicator, truth(NEIGHBOURS)),
    "agents.estimators.blocks.block_diagonal": of(blocks.block_diagonal, real(NEIGHBOURS, 2, 2)),
    "agents.estimators.blocks.diagonal_blocks": of(lambda matrix: blocks.diagonal_blocks(matrix, 2), real(18, 18)),
    "agents.estimators.edge_kf.of_edges": of(
        lambda process: edge_kf.of_edges(_brief(process=process, dimension=2)), real(18, 18)
    ),
    "agents.estimators.geometry.gram": of(geometry.gram, real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    "agents.estimators.geometry.inverse_gram": of(geometry.inverse_gram, covariance(2, 2), truth()),
    "agents.estimators.geometry.apply": of(geometry.apply, real(2, 2), real(NEIGHBOURS, 2)),
    "agents.estimators.geometry.total": of(geometry.total, truth(NEIGHBOURS), real(NEIGHBOURS, 2, 2)),
    "agents.estimators.geometry.indicator": of(
        lambda theta, gram, theirs, counts: geometry.indicator(_fit(theta, gram), theirs, counts),
        *(real(2, 2), covariance(2, 2), real(NEIGHBOURS, 2, 2), truth(NEIGHBOURS)),
    ),
    "agents.estimators.inputs.Flown.last": of(
        lambda flown, spread: inputs.Flown(flown, spread).last, real(NEIGHBOURS, 2, 2), covariance(NEIGHBOURS, 2, 2, 2)
    ),
    "agents.estimators.inputs.hear": of(
        lambda flown, spread, velocity, fresh: inputs.hear(
            inputs.Flown(flown, spread), Heard({"velocity": velocity}, fresh), np.linspace(0.5, -0.3, 9), 0.2
        ),
        *(real(NEIGHBOURS, 9, 2), covariance(NEIGHBOURS, 9, 2, 2), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.estimators.joint_kf.corrected": of(
        joint_kf.corrected,
        *(real(NEIGHBOURS, 2), covariance(18, 18), real(NEIGHBOURS, 2), covariance(18, 18), truth(NEIGHBOURS)),
    ),
    "agents.estimators.kalman.predict": of(
        lambda mean, spread: kalman.predict(mean, spread, F, Q), real(NEIGHBOURS, 4), covariance(NEIGHBOURS, 4, 4)
    ),
    "agents.estimators.kalman.correct": of(
        lambda mean, spread, seen, usable: kalman.correct(mean, spread, seen, NOISE, usable),
        *(real(NEIGHBOURS, 4), covariance(NEIGHBOURS, 4, 4), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.estimators.prediction.carried": of(
        lambda mean, spread, s: prediction.carried(TARGET, Prediction(mean, spread, None), s),
        *(real(3, 2), covariance(3, 3), share()),
    ),
    "agents.estimators.prediction.predicted": of(
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
    "agents.estimators.rkf.EdgeFilters.advance": of(
        lambda mean, spread, known, position, usable: FILTERS.advance(
            BRIEF, Tracks(mean, spread, known), position, NOISE, usable
        ),
        *(real(NEIGHBOURS, 6), covariance(NEIGHBOURS, 6, 6), truth(NEIGHBOURS), real(NEIGHBOURS, 2), truth(NEIGHBOURS)),
    ),
    "agents.estimators.rkf.EdgeFilters.estimate": of(
        lambda mean, spread, known: FILTERS.estimate(BRIEF, Tracks(mean, spread, known), known[..., 0]),
        *(real(NEIGHBOURS, 6), covariance(NEIGHBOURS, 6, 6), truth(NEIGHBOURS)),
    ),
    "agents.estimators.redcho.Consensus.outputs": of(CONSENSUS.outputs, real(4, 9, axis=1), real(4, 9), out=1),
    "agents.estimators.redcho.Consensus.step": of(
        lambda internal, own, theirs: CONSENSUS.step(internal, own, theirs, 0.013),
        *(real(4, 9), real(9), real(NEIGHBOURS, 9)),
    ),
    **{
        f"agents.estimators.small.{function.__name__} ({dimension})": of(
            function, covariance(dimension, dimension), rows=100
        )
        for function in (small.determinant, small.inverse, small.rotation, small.triangle)
        for dimension in (2, 3)
    },
    **{
        f"agents.estimators.{what} ({dimension})": case
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
