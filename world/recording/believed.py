"""What a recording shows of estimates: where each agent believes its neighbours are, and how surely."""

from __future__ import annotations

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from analysis.models.arrays import Array, Mask
from world.recording.stage import Stage, Stretch, spatial

_COLOUR = 0xF48FB1A0
_DEVIATIONS = 2.0


class Believed:
    """Logs an ellipse of two standard deviations for each edge that an agent estimates.

    Parameters
    ----------
    stage
        Where.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        look = rr.Ellipsoids3D.from_fields(
            colors=_COLOUR, line_radii=rr.Radius.ui_points(0.5), fill_mode=rr.components.FillMode.MajorWireframe
        )
        self._stage.still("swarm/believed", look)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        moments = stretch.moments
        estimate, packed = moments.estimate[stretch.kept], moments.covariance[stretch.kept]
        known = moments.known[stretch.kept] & np.isfinite(packed).all(axis=-1) & np.isfinite(estimate).all(axis=-1)
        centres = (stretch.position[:, :, None] - estimate)[known]
        half_sizes, turned = _ellipsoids(packed[known], estimate.shape[-1])
        columns = rr.Ellipsoids3D.columns(centers=spatial(centres), half_sizes=half_sizes, quaternions=turned)
        self._stage.stream.send_columns("swarm/believed", stretch.time, columns.partition(_numbers(known)))


def _numbers(known: Mask) -> list[int]:
    counts: list[int] = known.sum(axis=(1, 2)).tolist()
    return counts


def _ellipsoids(packed: Array, dimension: int) -> tuple[Array, Array]:
    """Half sizes (K, 3) and orientations (K, 4) of ellipsoids, for upper triangles of covariances (K, D (D + 1) / 2)."""
    rows, columns = np.triu_indices(dimension)
    covariance = np.zeros((len(packed), dimension, dimension))
    covariance[:, rows, columns] = covariance[:, columns, rows] = packed
    values, vectors = np.linalg.eigh(covariance)
    axes = np.broadcast_to(np.eye(3), (len(packed), 3, 3)).copy()
    axes[:, :dimension, :dimension] = vectors
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]  # an axis either way is the same ellipsoid
    return spatial(_DEVIATIONS * np.sqrt(np.maximum(values, 0.0))), Rotation.from_matrix(axes).as_quat()
