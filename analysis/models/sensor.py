"""What measures relative positions, in axes that all agents share: by coordinates, by range and bearing, or along and across.

And what measures their directions alone. A sensor of another quantity joins here, by its keys in
`affinet/scenario/sections.py`, and by the estimator that uses what it says.

A range and a bearing make the error of a position depend on where it is, and correlate its coordinates (paper 004, section
4.1.1). They also draw it toward the agent, by a factor that is known: the positions here are corrected for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.models.arrays import Array
from analysis.models.elementary import arctan2, cos, exp, expm1, hypot, sin
from analysis.models.unsuited import Unsuited

# Along the line of sight a direction leaves as much open as this many times the distance, which costs filters no digits that
# count; and nothing is taken for nearer than so many metres.
_BLIND, _NEAREST = 1e3, 1e-6


@dataclass(frozen=True)
class Sensor:
    """A sensor of relative positions.

    Parameters
    ----------
    reads
        Coordinates; or range and bearing, in three dimensions range, azimuth and elevation; or a position along and across the
        line of sight, as wrong as it is far (paper 003, section VII); or a direction, a unit vector.
    covariance
        Of what it reads, shape (D, D): in square metres, of angles in square radians, or as shares of the square of the
        distance; of a direction, of the angles by which it is off, shape (D - 1, D - 1), in square radians. All but that of
        coordinates is diagonal, and the same for all directions across.
    """

    reads: Literal["coordinates", "range-bearing", "line-of-sight", "direction"]
    covariance: Array

    def measured(self, true: Array, noise: Array) -> Array:
        """What it says of relative positions.

        Parameters
        ----------
        true
            Shape (..., D), in metres.
        noise
            With the covariance of the sensor, shape (..., D), or (..., D - 1).
        """
        if self.reads == "coordinates":
            return true + noise
        if self.reads == "line-of-sight":
            return true + _turned(true, np.linalg.norm(true, axis=-1, keepdims=True) * noise)
        if self.reads == "direction":
            return _swung(true, noise)
        return self.of_polar(_polar(true) + noise)

    def of_polar(self, read: Array) -> Array:
        """What it says where range and bearing were read, and azimuth and elevation in three dimensions, shape (..., D)."""
        position = _cartesian(read)
        return position / _shrinking(self._variances) if self.reads == "range-bearing" else position

    @property
    def says_positions(self) -> bool:
        """Whether it says how far away things are."""
        return self.reads != "direction"

    def exact(self, true: Array) -> Array:
        """What it would say of relative positions (..., D), in metres, without noise."""
        return true if self.says_positions else _swung(true, np.zeros((*true.shape[:-1], true.shape[-1] - 1)))

    def observed(self, measured: Array, expected: Array, doubt: Array) -> tuple[Array, Array]:
        """Measurements as relative positions (..., D), and their covariances (..., D, D), in square metres, as in `weight`.

        A direction says where across the line to where a thing is expected it is, at the distance at which it is expected, and
        next to nothing of how far: an extended Kalman filter's measurement of a bearing (Aidala, IEEE Transactions on Aerospace
        and Electronic Systems 15(1), 1979). By the line measured, whose error is that of the measurement, filters find
        distances where there is no parallax.

        Parameters
        ----------
        measured
            What it said, shape (..., D).
        expected, doubt
            Where the estimator takes things to be before this, shape (..., D), in metres, and the covariance of that, shape
            (..., D, D), in square metres.
        """
        if self.says_positions:
            return measured, self.weight(measured, expected, doubt)
        distance = np.maximum(np.linalg.norm(expected, axis=-1, keepdims=True), _NEAREST)
        toward = expected / distance
        aside = measured - (measured * toward).sum(axis=-1, keepdims=True) * toward
        squared = (distance * distance)[..., None]
        line = toward[..., :, None] * toward[..., None, :]
        across = np.eye(measured.shape[-1]) - line
        return expected + distance * aside, squared * (self._variances[0] * across + _BLIND * _BLIND * line)

    def weight(self, measured: Array, expected: Array, doubt: Array) -> Array:
        """The covariances (..., D, D) by which a filter weighs measured positions (..., D), in square metres.

        Where the covariance of a position hangs on where it is, it is that at the position expected, once that is surer than
        the measurement: taken at the measurement it hangs on the error, and draws a filter to one side.

        Parameters
        ----------
        measured, expected, doubt
            As in `observed`.

        Raises
        ------
        Unsuited
            When it says directions alone.
        """
        spread = self.spread(measured)
        if self.is_even:
            return spread
        surer = np.einsum("...ii", doubt) < np.einsum("...ii", spread)
        return np.where(surer[..., None, None], self._expected(expected, doubt), spread)

    def require_positions(self) -> None:
        """Fail where it says none.

        Raises
        ------
        Unsuited
            When it says directions alone.
        """
        if not self.says_positions:
            raise Unsuited(
                "this estimator takes what is measured for a relative position, and this sensor says the direction alone; "
                "choose 'edge-kf', which finds the distance by how both ends fly, or another sensor"
            )

    def spread(self, measured: Array) -> Array:
        """Covariances of measurements (..., D), shape (..., D, D), in m2: of ranges and bearings, that at what they say.

        Raises
        ------
        Unsuited
            When it says directions alone.
        """
        self.require_positions()
        if self.is_even:
            return np.broadcast_to(self.covariance, (*measured.shape, measured.shape[-1]))
        if self.reads == "line-of-sight":
            return self._of_lines(measured[..., :, None] * measured[..., None, :])
        _, covariance = moments(_polar(measured), self._variances)
        shrinking = _shrinking(self._variances)
        return covariance / (shrinking[:, None] * shrinking)

    def _expected(self, position: Array, doubt: Array) -> Array:
        """The covariance of measurements of things that are about here (..., D), with covariances `doubt` (..., D, D)."""
        if self.reads == "line-of-sight":
            return self._of_lines(position[..., :, None] * position[..., None, :] + doubt)
        return self.spread(position)

    def _of_lines(self, second: Array) -> Array:
        """Along and across lines of sight, of second moments (..., D, D), as shares of the squared distance."""
        along, across = self._variances[:2]
        squared = np.einsum("...ii", second)[..., None, None]
        spread: Array = across * squared * np.eye(second.shape[-1]) + (along - across) * second
        return spread

    @property
    def is_even(self) -> bool:
        """Whether all its measurements have one covariance, which is then `common`."""
        return self.reads == "coordinates"

    @property
    def common(self) -> Array:
        """The covariance of every measurement, shape (D, D), in square metres.

        Raises
        ------
        Unsuited
            When each measurement has its own, or says a direction alone.
        """
        self.require_positions()
        if not self.is_even:
            raise Unsuited(
                "this estimator takes one covariance for all measurements, and this sensor gives each its own; "
                "choose another, or a sensor of coordinates"
            )
        return self.covariance

    @property
    def _variances(self) -> Array:
        return np.diagonal(self.covariance)


def moments(polar: Array, variances: Array) -> tuple[Array, Array]:
    """Mean (..., D) and covariance (..., D, D) of positions read as range and bearings (paper 004, (4.3) and (4.4)).

    The covariance is the printed one without its differences of large numbers, of which a sharp sensor would leave nothing.

    Parameters
    ----------
    polar
        Means of range, azimuth and, in three dimensions, elevation, shape (..., D), in metres and radians.
    variances
        Theirs, shape (D,), in square metres and square radians.
    """
    reach = polar[..., 0]
    mean, second, covariance = _direction(polar[..., 1:], variances[1:])
    squared = (reach * reach)[..., None, None]
    return reach[..., None] * mean, variances[0] * second + squared * covariance


def _direction(angles: Array, variances: Array) -> tuple[Array, Array, Array]:
    """Mean, second moments and covariance of a unit vector at normal angles (..., 1) or (..., 2)."""
    mean, second, covariance = _circle(angles[..., 0], variances[0])
    if angles.shape[-1] == 1:
        return mean, second, covariance
    up, up_second, up_covariance = _circle(angles[..., 1], variances[1])
    planar, squared = up[..., :1], up_second[..., :1, :1]
    across = up_covariance[..., 0, 1, None] * mean

    def joined(level: Array, tilted: Array, upright: Array) -> Array:
        rows = np.concatenate([level, tilted[..., :, None]], axis=-1)
        last = np.concatenate([tilted, upright[..., None]], axis=-1)
        return np.concatenate([rows, last[..., None, :]], axis=-2)

    return (
        np.concatenate([planar * mean, up[..., 1:]], axis=-1),
        joined(squared * second, up_second[..., 0, 1, None] * mean, up_second[..., 1, 1]),
        joined(
            up_covariance[..., :1, :1] * second + (planar * planar)[..., None] * covariance,
            across,
            up_covariance[..., 1, 1],
        ),
    )


def _circle(angle: Array, variance: float) -> tuple[Array, Array, Array]:
    """Mean (..., 2), second moments and covariance (..., 2, 2) of cosine and sine of a normal angle."""
    kept, lost = exp(-variance), -expm1(-variance)
    cosine, sine = cos(2.0 * angle), sin(2.0 * angle)
    mean = np.sqrt(kept) * np.stack([cos(angle), sin(angle)], axis=-1)
    second = 0.5 * _matrix(1.0 + kept * kept * cosine, kept * kept * sine, 1.0 - kept * kept * cosine)
    covariance = 0.5 * lost * _matrix(1.0 - kept * cosine, -kept * sine, 1.0 + kept * cosine)
    return mean, second, covariance


def _matrix(first: Array, mixed: Array, last: Array) -> Array:
    return np.stack([np.stack([first, mixed], axis=-1), np.stack([mixed, last], axis=-1)], axis=-2)


def _shrinking(variances: Array) -> Array:
    """By what factors the mean of the coordinates is too small (4.3), shape (D,)."""
    angles = exp(-variances[1:] / 2)
    level = angles.prod()
    return np.array([level, level, *angles[1:]])


def _polar(position: Array) -> Array:
    planar = hypot(position[..., 0], position[..., 1])
    azimuth = arctan2(position[..., 1], position[..., 0])
    if position.shape[-1] == 2:
        return np.stack([planar, azimuth], axis=-1)
    return np.stack([hypot(planar, position[..., 2]), azimuth, arctan2(position[..., 2], planar)], axis=-1)


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


def _swung(line: Array, angles: Array) -> Array:
    """Unit vectors along lines (..., D), swung by angles (..., D - 1) across them, in radians."""
    length = np.linalg.norm(line, axis=-1, keepdims=True)
    first = np.eye(line.shape[-1])[0]
    direction = np.where(length > 0.0, line, first) / np.where(length > 0.0, length, 1.0)
    angle = np.linalg.norm(angles, axis=-1, keepdims=True)
    aside = _turned(direction, np.concatenate([np.zeros_like(angle), angles], axis=-1))
    share = np.where(angle > 0.0, sin(angle) / np.where(angle > 0.0, angle, 1.0), 1.0)
    return cos(angle) * direction + share * aside


def _cartesian(polar: Array) -> Array:
    reach, azimuth = polar[..., 0], polar[..., 1]
    if polar.shape[-1] == 2:
        return np.stack([reach * cos(azimuth), reach * sin(azimuth)], axis=-1)
    planar = reach * cos(polar[..., 2])
    return np.stack([planar * cos(azimuth), planar * sin(azimuth), reach * sin(polar[..., 2])], axis=-1)
