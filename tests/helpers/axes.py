"""Models of motion of all axes, from those of one."""

import numpy as np


def of_axes(dimension, F, Q):
    """Transition and process noise of a state of so many axes, ordered by derivatives, shape (O D, O D) each."""
    return np.kron(F, np.eye(dimension)), np.kron(Q, np.eye(dimension))
