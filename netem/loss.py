"""Independent loss: the Bernoulli availability of paper 000, section VII-C."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def lost(availability: NDArray[np.float64], draw: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True where a message is lost: independent, with probability 1 - availability.

    Parameters
    ----------
    availability
        Probability in [0, 1] that a message gets through, shape (L,).
    draw
        Uniform in (0, 1), shape (..., L).

    Returns
    -------
    NDArray[bool]
        Shape (..., L). Mean loss 1 - availability; mean burst 1 / availability.
    """
    decided: NDArray[np.bool_] = draw >= availability
    return decided
