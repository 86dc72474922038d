"""What measures relative positions, in axes that all agents share: by coordinates, by range and bearing, or along and across.

A range and a bearing make the error of a position depend on where it is, and correlate its coordinates (paper 004, section
4.1.1). They also draw it toward the agent, by a factor that is known: the positions here are corrected for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sensor:
    """A sensor of relative positions.

    Parameters
    ----------
    reads
        Coordinates; or range and bearing, in three dimensions range, azimuth and elevation; or a position along and across the
        line of sight, as wrong as it is far (paper 003, section VII).
    covariance
        Of what it reads, shape (D, D): in square metres, of angles in square radians, or as shares of the square of the
        distance. All but that of coordinates is diagonal, and the same for all directions across.
    """

    reads: Literal["coordinates", "range-bearing", "line-of-sight"]
    covariance: Array

    def measured(self, true: Array, noise: Array) -> Array:
        """What it says of relative positions.

        Parameters
        ----------
        true
            Shape (..., D), in metres.
        noise
            With the covariance of the sensor, shape (..., D).
        """
        if self.reads == "coordinates":
            return true + noise
        if self.reads == "line-of-sight":
            return true + _turned(true, np.linalg.norm(true, axis=-1, keepdims=True) * noise)
        return _cartesian(_polar(true) + noise) / _shrinking(self._variances)

    def spread(self, measured: Array) -> Array:
        """Covariances of measurements (..., D), shape (..., D, D), in m2: of ranges and bearings, that at what they say."""
        if self.reads == "coordinates":
            return np.broadcast_to(self.covariance, (*measured.shape, measured.shape[-1]))
        if self.reads == "line-of-sight":
            along, across = self._variances[:2]
            lines = measured[..., :, None] * measured[..., None, :]
            squared = (measured * measured).sum(axis=-1)[..., None, None]
            spread: Array = across * squared * np.eye(measured.shape[-1]) + (along - across) * lines
            return spread
        mean, second = moments(_polar(measured), self._variances)
        shrinking = _shrinking(self._variances)
        covariance: Array = second - mean[..., :, None] * mean[..., None, :]
        return covariance / (shrinking[:, None] * shrinking)

    @property
    def common(self) -> Array:
        """The covariance of every measurement, shape (D, D), in square metres.

        Raises
        ------
        ValueError
            When each measurement has its own.
        """
        if self.reads != "coordinates":
            raise ValueError(
                "this estimator takes one covariance for all measurements, and this sensor gives each its own; "
                "choose another, or a sensor of coordinates"
            )
        return self.covariance

    @property
    def _variances(self) -> Array:
        return np.diagonal(self.covariance)


def moments(polar: Array, variances: Array) -> tuple[Array, Array]:
    """Mean (..., D) and second moments (..., D, D) of positions read as range and bearings (paper 004, (4.3) and (4.4)).

    Parameters
    ----------
    polar
        Means of range, azimuth and, in three dimensions, elevation, shape (..., D), in metres and radians.
    variances
        Theirs, shape (D,), in square metres and square radians.
    """
    mean = _cartesian(polar) * _shrinking(variances)
    reach = (polar[..., 0] ** 2 + variances[0])[..., None, None]
    level = _squares(polar[..., 1], variances[1])
    if polar.shape[-1] == 2:
        return mean, reach * level
    upright = _squares(polar[..., 2], variances[2])
    damped = np.exp(-variances[1] / 2) * np.stack([np.cos(polar[..., 1]), np.sin(polar[..., 1])], axis=-1)
    second = np.empty((*mean.shape, 3))
    second[..., :2, :2] = upright[..., :1, :1] * level
    second[..., :2, 2] = second[..., 2, :2] = upright[..., 0, 1, None] * damped
    second[..., 2, 2] = upright[..., 1, 1]
    return mean, reach * second


def _squares(angle: Array, variance: float) -> Array:
    """E [c s]' [c s] of cosine and sine of a normal angle, shape (..., 2, 2)."""
    damping = np.exp(-2.0 * variance)
    cosine, sine = damping * np.cos(2.0 * angle), damping * np.sin(2.0 * angle)
    rows = [np.stack([1.0 + cosine, sine], axis=-1), np.stack([sine, 1.0 - cosine], axis=-1)]
    halves: Array = 0.5 * np.stack(rows, axis=-2)
    return halves


def _shrinking(variances: Array) -> Array:
    """By what factors the mean of the coordinates is too small (4.3), shape (D,)."""
    angles = np.exp(-variances[1:] / 2)
    level = angles.prod()
    return np.array([level, level, *angles[1:]])


def _polar(position: Array) -> Array:
    planar = np.hypot(position[..., 0], position[..., 1])
    azimuth = np.arctan2(position[..., 1], position[..., 0])
    if position.shape[-1] == 2:
        return np.stack([planar, azimuth], axis=-1)
    return np.stack([np.hypot(planar, position[..., 2]), azimuth, np.arctan2(position[..., 2], planar)], axis=-1)


def _turned(line: Array, offset: Array) -> Array:
    """Offsets along the first axis and across it (..., D), turned so that the first axis lies along lines (..., D)."""
    length = np.linalg.norm(line, axis=-1, keepdims=True)
    first = np.eye(line.shape[-1])[0]
    direction = np.where(length > 0.0, line, first) / np.where(length > 0.0, length, 1.0)
    # A reflection that swaps the first axis and the direction: what lies across is spread alike to all sides.
    mirror = direction - first
    size = (mirror * mirror).sum(axis=-1, keepdims=True)
    along_mirror = (offset * mirror).sum(axis=-1, keepdims=True)
    turned: Array = offset - np.where(size > 0.0, 2.0 * along_mirror / np.where(size > 0.0, size, 1.0), 0.0) * mirror
    return turned


def _cartesian(polar: Array) -> Array:
    reach, azimuth = polar[..., 0], polar[..., 1]
    if polar.shape[-1] == 2:
        return np.stack([reach * np.cos(azimuth), reach * np.sin(azimuth)], axis=-1)
    planar = reach * np.cos(polar[..., 2])
    return np.stack([planar * np.cos(azimuth), planar * np.sin(azimuth), reach * np.sin(polar[..., 2])], axis=-1)
