"""A flight that was flown before, and stands in for physics: what was sensed, where everybody was, and what they flew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.models.arrays import Array


@dataclass(frozen=True)
class RecordedFlight:
    """A flight as its log has it, tick by tick.

    Parameters
    ----------
    measured
        What the sensors said of every directed link, shape (T, L, D), in metres or as a unit vector; NaN in gaps.
    position
        Where everybody was, shape (T + 1, N, D), in metres, what estimates are held against; NaN without a reference.
    input
        What everybody flew from each tick on, shape (T, N, D), in metres per second.
    """

    measured: Array
    position: Array
    input: Array

    @property
    def has_reference(self) -> bool:
        """Whether it is known where everybody was."""
        return not bool(np.isnan(self.position).any())

    def flown_before(self, tick: int) -> Array:
        """What everybody flies when a tick begins, shape (N, D), in metres per second: the input of the tick before."""
        return self.input[tick - 1] if tick else np.zeros_like(self.input[0])

    def side_by_side(self, number: int) -> RecordedFlight:
        """The same flight, flown so many times beside itself."""
        return RecordedFlight(
            *(np.tile(of_all, (1, number, 1)) for of_all in (self.measured, self.position, self.input))
        )
