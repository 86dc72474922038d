"""`analysis`."""

import numpy as np

from analysis.metrics import consistency, errors, indicator, localization
from analysis.models import (
    affine,
    algebra,
    arrays,
    elementary,
    graph,
    information,
    jacobi,
    jets,
    pursuit,
    sensor,
    small,
)
from rows.case import covariance, of, real, share, truth, whole

MANY = 500  # numbers that round apart once in a thousand times
AGENTS, EDGES = 10, np.array([[1, 2], [2, 3], [3, 4], [4, 5], [5, 6], [6, 7], [7, 8], [8, 9], [9, 10], [1, 10], [1, 5]])
SRC, DST = EDGES.T
NOMINAL = np.random.default_rng(5).normal(size=(AGENTS, 2))
MANOEUVRE = affine.Manoeuvre(*(np.random.default_rng(6).normal(size=(20, *size)) for size in ((2, 2), (2,))))
SENSORS = {
    "coordinates": sensor.Sensor("coordinates", np.array([[0.02, 0.01], [0.01, 0.03]])),
    "range-bearing": sensor.Sensor("range-bearing", np.diag([0.02, 0.03])),
    "range-bearing in space": sensor.Sensor("range-bearing", np.diag([0.02, 0.03, 0.01])),
    "line-of-sight": sensor.Sensor("line-of-sight", np.diag([0.02, 0.03, 0.03])),
}


def _edges(information, relative):
    return jacobi.together(relative, information)


def _of_edges(function):
    return of(
        lambda information, relative: function(_edges(information, relative)), covariance(5, 5, 2, 2), real(5, 5, 2)
    )


CASES = {
    **{
        f"analysis.models.small.{function.__name__} ({dimension})": of(
            function, covariance(dimension, dimension), rows=100
        )
        for function in (small.determinant, small.inverse, small.rotation, small.triangle)
        for dimension in (2, 3)
    },
    "analysis.models.arrays.chosen": of(arrays.chosen, truth(), real(9, 2), real(9, 2)),
    "analysis.models.arrays.chosen (tuples)": of(
        lambda which, one, other: arrays.chosen(which, (one, (one,)), (other, (other,))), truth(), real(9), real(9)
    ),
    "analysis.models.elementary.whole_power": of(lambda x: elementary.whole_power(x, 3), real(), rows=MANY),
    "analysis.models.elementary.whole_powers": of(lambda x: elementary.whole_powers(x, 4), real(), rows=MANY),
    "analysis.models.elementary.power": of(elementary.power, share(), real(), rows=MANY),
    "analysis.models.elementary.hypot": of(elementary.hypot, real(), real(), rows=MANY),
    "analysis.models.elementary.exp": of(elementary.exp, real(), rows=MANY),
    "analysis.models.elementary.expm1": of(elementary.expm1, real(), rows=MANY),
    "analysis.models.elementary.log": of(elementary.log, share(), rows=MANY),
    "analysis.models.elementary.sin": of(elementary.sin, real(), rows=MANY),
    "analysis.models.elementary.cos": of(elementary.cos, real(), rows=MANY),
    "analysis.models.elementary.arctan2": of(elementary.arctan2, real(), real(), rows=MANY),
    "analysis.models.algebra.product": of(algebra.product, real(9, 9), real(9, 9), real(9, 2)),
    "analysis.models.algebra.sum_over": of(lambda x: algebra.sum_over(x, -1), real(3, 19)),
    "analysis.models.jets.power": of(lambda x, rate: jets.power(x, 3, rate, 3), share(), real(), rows=4000, out=1),
    "analysis.models.jets.times": of(jets.times, real(3, 3, 3, axis=1), real(3, 3, 2, axis=1), out=1),
    "analysis.models.jets.scaled": of(jets.scaled, real(3, axis=1), real(3, 3, 2, axis=1), out=1),
    "analysis.models.jets.inverse": of(jets.inverse, covariance(3, 3, 3, axis=1), out=1),
    "analysis.models.jets.quotient": of(jets.quotient, real(3, axis=1), real(3, axis=1), rows=MANY, out=1),
    "analysis.models.pursuit.transition": of(lambda s: pursuit.transition(4, s), share(), rows=MANY),
    "analysis.models.pursuit.diffusion": of(lambda s: pursuit.diffusion(4, s, 0.7), share(), rows=MANY),
    **{
        f"analysis.models.sensor.Sensor.{what} ({name})": of(function, *arguments)
        for name, one in SENSORS.items()
        for dimension in [3 if one.covariance.shape[-1] == 3 else 2]
        for what, function, arguments in (
            ("measured", one.measured, (real(9, dimension), real(9, dimension))),
            ("of_polar", one.of_polar, (real(9, dimension),)),
            ("spread", one.spread, (real(9, dimension),)),
            ("weight", one.weight, (real(9, dimension), real(9, dimension), covariance(9, dimension, dimension))),
            ("observed", one.observed, (real(9, dimension), real(9, dimension), covariance(9, dimension, dimension))),
        )
    },
    **{
        f"analysis.models.sensor.Sensor.{what} (direction in {dimension})": of(function, *arguments)
        for dimension in (2, 3)
        for one in [sensor.Sensor("direction", 0.02 * np.eye(dimension - 1))]
        for what, function, arguments in (
            ("measured", one.measured, (real(9, dimension), real(9, dimension - 1))),
            ("exact", one.exact, (real(9, dimension),)),
            ("observed", one.observed, (real(9, dimension), real(9, dimension), covariance(9, dimension, dimension))),
        )
    },
    "analysis.models.sensor.moments": of(lambda polar: sensor.moments(polar, np.array([0.1, 0.2, 0.3])), real(9, 3)),
    "analysis.models.affine.Manoeuvre.target": of(lambda p: MANOEUVRE.target(3, p), real(9, 2)),
    "analysis.models.affine.Manoeuvre.velocity": of(lambda k, p: MANOEUVRE.velocity(k, p, 0.1), whole(20), real(2)),
    "analysis.models.affine.Manoeuvre.acceleration": of(
        lambda k, p: MANOEUVRE.acceleration(k, p, 0.1), whole(20), real(2)
    ),
    "analysis.metrics.consistency.of_errors": of(
        consistency.of_errors, real(4, 9, 2), real(4, 9, 2), real(4, 9, 3), truth(4, 9)
    ),
    "analysis.metrics.consistency.of_innovations": of(consistency.of_innovations, real(4, 9), truth(4, 9)),
    "analysis.metrics.consistency.band": of(lambda number: consistency.band(0.9, 2, number), whole(99)),
    "analysis.metrics.consistency.nees": of(consistency.nees, real(9, 3), real(9, 6)),
    "analysis.metrics.consistency.whole": of(consistency.whole, real(9, 6)),
    "analysis.models.graph.mutual": of(graph.mutual, truth(AGENTS, AGENTS)),
    "analysis.models.graph.adjacency": of(lambda heard: graph.adjacency(heard, SRC, DST, AGENTS), truth(11)),
    "analysis.models.graph.undirected": of(
        lambda heard: graph.undirected(heard, np.r_[SRC, DST], np.r_[DST, SRC], EDGES), truth(22)
    ),
    "analysis.models.graph.joint": of(lambda heard: graph.joint(heard, 3), truth(9, 11)),
    "analysis.models.graph.age": of(graph.age, whole(9, 9, 11)),
    "analysis.models.graph.algebraic_connectivity": of(
        graph.algebraic_connectivity, truth(AGENTS, AGENTS), truth(AGENTS, p=0.9)
    ),
    "analysis.models.graph.connected": of(graph.connected, truth(AGENTS, AGENTS)),
    "analysis.models.graph.rooted": of(lambda heard: graph.rooted(heard, [1, 2]), truth(AGENTS, AGENTS, p=0.2)),
    "analysis.models.graph.reached": of(graph.reached, truth(AGENTS, AGENTS, p=0.2)),
    "analysis.models.graph.feasible": of(lambda heard: graph.feasible(heard, SRC, DST, NOMINAL), truth(11)),
    "analysis.models.graph.grams": of(graph.grams, truth(AGENTS, AGENTS), real(AGENTS, 2)),
    "analysis.models.graph.regular": of(graph.regular, covariance(9, 2, 2)),
    "analysis.models.graph.stress_dimension": of(lambda up: graph.stress_dimension(up, EDGES, NOMINAL), truth(11)),
    "analysis.metrics.indicator.bounds": of(
        lambda nominal, heard: indicator.bounds(nominal, heard, np.diag([0.1, 0.2])),
        *(real(AGENTS, 2), truth(AGENTS, AGENTS)),
    ),
    "analysis.models.information.packed": of(information.packed, covariance(3, 3), real(3, 2)),
    "analysis.models.information.unpacked": of(lambda packed: information.unpacked(packed, 2, 3), real(12)),
    "analysis.models.information.position": of(
        lambda Q, y: information.position(information.packed(Q, y), 2, 3), covariance(3, 3), real(3, 2)
    ),
    "analysis.models.information.position_jet": of(
        information.position_jet, covariance(4, 3, 3, axis=1), real(4, 3, 2, axis=1), out=1
    ),
    "analysis.models.jacobi.together": of(_edges, covariance(5, 5, 2, 2), real(5, 5, 2)),
    "analysis.models.jacobi.weights": _of_edges(jacobi.weights),
    "analysis.models.jacobi.system": _of_edges(jacobi.system),
    "analysis.metrics.localization.optimal": _of_edges(localization.optimal),
    "analysis.models.jacobi.spectrum": _of_edges(jacobi.spectrum),
    "analysis.metrics.localization.centred": of(localization.centred, real(9, 2), covariance(9, 2, 2)),
    "analysis.metrics.localization.centroid": of(localization.centroid, real(9, 2), covariance(9, 2, 2)),
    **{
        f"analysis.metrics.localization.{function.__name__}": of(
            lambda place, given, relative, function=function: function(place, _edges(given, relative)),
            *(real(5, 2), covariance(5, 5, 2, 2), real(5, 5, 2)),
        )
        for function in (localization.beside, localization.distance)
    },
    "analysis.metrics.localization.anchored": _of_edges(lambda edges: localization.anchored(edges, 1)),
    "analysis.metrics.localization.spread": _of_edges(localization.spread),
    "analysis.metrics.localization.place_error": of(localization.place_error, real(9, 2), real(9, 2)),
    "analysis.metrics.localization.place_nees": of(
        lambda place, true, information, relative: localization.place_nees(place, true, _edges(information, relative)),
        *(real(5, 2), real(5, 2), covariance(5, 5, 2, 2), real(5, 5, 2)),
    ),
    "analysis.metrics.localization.ringing": of(localization.ringing, real(6, 9, 2)),
    "analysis.metrics.errors.tracking_error": of(
        errors.tracking_error, real(AGENTS, 2), real(AGENTS, 2), truth(AGENTS)
    ),
    "analysis.metrics.errors.root_mean_square": of(errors.root_mean_square, real(AGENTS, 2), truth(AGENTS)),
    "analysis.metrics.errors.procrustes_error": of(
        lambda z, present: errors.procrustes_error(z, NOMINAL, present), real(AGENTS, 2), truth(AGENTS)
    ),
    "analysis.metrics.errors.estimation_error": of(
        errors.estimation_error, real(AGENTS, 9, 2), real(AGENTS, 9, 2), truth(AGENTS, 9)
    ),
    "analysis.metrics.errors.tick_flown": of(
        lambda earlier, before, now, target, steered, present: errors.tick_flown(
            (earlier, before, now), target, steered, present
        ),
        *[real(AGENTS, 2)] * 5,
        truth(AGENTS),
    ),
    "analysis.metrics.errors.rate_of_fall": of(
        lambda error: errors.rate_of_fall(np.arange(7.0), error * error), real(7)
    ),
    "analysis.metrics.errors.covariance_trace": of(lambda t: errors.covariance_trace(t, 3), real(AGENTS, 9, 6)),
}
