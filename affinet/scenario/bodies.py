"""The tables of sensors and of bodies, and what they make: how wrong a measurement is, and what displaces a body."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from pydantic import model_validator

from affinet.scenario.keys import key
from affinet.scenario.matrices import covariance
from affinet.scenario.section import Section
from affinet.scenario.units import Bearing, Below1, Matrix, NotNegative, Positive, ShareOfDistance, Steps
from analysis.models.sensor import Sensor
from world.physics.bodies import BodyModel

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
    R = covariance("sensing", sensing.sigma, sensing.covariance, dimension)
    return Sensor("coordinates", R / sensing.samples)


def displacement(dynamics: DynamicsSection, dimension: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Q_D of one agent in a tick, shape (D, D), in square metres.

    Raises
    ------
    ScenarioError
        When it is no covariance of this dimension.
    """
    return covariance("dynamics", dynamics.disturbance, dynamics.covariance, dimension)
