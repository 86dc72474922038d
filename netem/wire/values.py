"""What the numbers can mean that somebody else's program says: finite ones, of magnitudes that can be reckoned with.

What agents of ours say comes from an estimator that may diverge, as a scenario may want it to (gains, lies, corrupted
messages); that is judged as it is without a network, by the verdict. Who flies a program of one's own in their place has to
look after that: from it, what no estimate can be is refused.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.models.arrays import Array
from netem.core.plain import shown
from netem.wire.wrong import WireError, Wrong

LARGEST = 1e150  # its square is a number
# Of an input, in m/s or m/s2, where the scenario sets no `agents.limit`: 100 km/s, or 10,000 g.
FASTEST = 1e5
_ROUNDING = 1e-9


def finite(given: Any, whose: str, *, undefined: bool = False) -> None:
    """Refuse what is no number, or too large for one; `undefined` ones may be NaN.

    Raises
    ------
    WireError
        When one is.
    """
    magnitude = np.abs(np.asarray(given, dtype=np.float64))
    fine = magnitude <= LARGEST
    if undefined:
        fine |= np.isnan(magnitude)
    if not fine.all():
        or_nan = ", or NaN" if undefined else ""
        _refuse(f"{whose}: expected numbers of at most {LARGEST:g}{or_nan}, got {_shown(given)}")


def within(given: Array, limit: float | None, whose: str) -> None:
    """Refuse an input (D,) that is longer than agents are allowed to command, or than any body could follow.

    Raises
    ------
    WireError
        When it is.
    """
    most = FASTEST if limit is None else limit
    if not sum(share * share for share in (given / most).tolist()) <= 1.0 + _ROUNDING:
        _refuse(f"{whose}: expected at most {most:g} in length (agents.limit), got {_shown(given)}")


def indicator(psi: float, whose: str) -> None:
    """Refuse a convergence indicator that is neither undefined nor a number from 0 on.

    Raises
    ------
    WireError
        When it is.
    """
    if not (psi != psi or 0.0 <= psi <= LARGEST):
        _refuse(f"{whose}: expected a number from 0 to {LARGEST:g}, or NaN, got {_shown(psi)}")


def variances(triangles: Array, dimension: int, whose: str) -> None:
    """Refuse covariances, upper triangles row by row (..., D (D + 1) / 2), with a negative variance.

    Raises
    ------
    WireError
        When there is one.
    """
    ends = np.arange(dimension, 0, -1)
    own = triangles[..., np.cumsum(ends) - ends]
    if (own < 0.0).any():
        _refuse(f"{whose}: expected variances of at least 0, got {_shown(own.min())}")


def _shown(given: Any) -> str:
    return shown(np.asarray(given).tolist())


def _refuse(says: str) -> None:
    raise WireError(f"{says} (see docs/protocol.md)", Wrong.VALUE)
