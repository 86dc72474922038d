"""REDCHO (paper 002, appendix C): agents agree on the average of signals and of its derivatives, while the signals change."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array
from analysis.models.elementary import power, whole_power
from analysis.models.finding import Finding

_SMALL_CHATTER = 1.0
_FORGOTTEN = 2.0  # an Euler step of -gamma diverges from here on


@dataclass(frozen=True)
class Consensus:
    """The protocol (14), by explicit Euler steps, for any number of signals at once.

    Parameters
    ----------
    order
        m: the highest derivative that is agreed on.
    theta, k, gamma
        Its gains; k and gamma have m + 1 entries.
    """

    order: int
    theta: float
    k: tuple[float, ...]
    gamma: tuple[float, ...]

    def outputs(self, local: Array, internal: Array) -> Array:
        """s_mu, shape (m + 1, ..., C), of jets of own signals (m + 1, ..., C) and internal variables (..., m + 1, C)."""
        mixed = product(_mixing(self.order, self.gamma), internal)
        agreed: Array = local - np.moveaxis(mixed, -2, 0)
        return agreed

    def step(self, internal: Array, own: Array, theirs: Array, dt: float) -> Array:
        """The internal variables a tick later.

        Parameters
        ----------
        internal
            Shape (..., m + 1, C).
        own
            s_0 of the agent, shape (..., C).
        theirs
            Those of its neighbours, shape (..., n, C); its own in place of those that count for nothing.
        dt
            Tick, in seconds.
        """
        apart = own[..., None, :] - theirs
        size, sign = np.abs(apart), np.sign(apart)
        rates = []
        for mu in range(self.order + 1):
            exponent = (self.order - mu) / (self.order + 1)
            pull = sum_over(power(size, exponent) * sign, -2)
            higher = internal[..., mu + 1, :] if mu < self.order else 0.0
            rates.append(
                self.k[mu] * whole_power(self.theta, mu + 1) * pull + higher - self.gamma[mu] * internal[..., mu, :]
            )
        stepped: Array = internal + dt * np.stack(rates, axis=-2)
        return stepped

    def findings(self, dt: float, *, aided: bool) -> list[Finding]:
        """How the protocol comes along with the tick; whether it is aided by derivatives of the agents' own.

        How hard its sign switches in a tick (errata), and whether a tick is short enough to forget by gamma what it gathered.
        """
        switched = self.k[self.order] * whole_power(self.theta, self.order + 1) * dt
        what = f"k_m theta^{self.order + 1} dt; 0.4 in paper 002"
        own = "" if aided or switched < _SMALL_CHATTER else "; take the agents' own derivatives"
        found = [
            Finding("REDCHO", "note", f"REDCHO switches its highest derivative by {switched:.3g} a tick ({what}){own}")
        ]
        fastest, bound = max(self.gamma), _FORGOTTEN / dt
        if fastest * dt >= _FORGOTTEN:
            says = f"gamma {fastest:g} 1/s is not below the bound {bound:g} at dt {dt:g} s: REDCHO diverges; lower it, or dt"
            found.append(Finding("REDCHO", "error", says))
        return found


@cache
def _mixing(order: int, gamma: tuple[float, ...]) -> Array:
    """G, shape (m + 1, m + 1): row mu is C_0 Gamma^mu, with Gamma = A_0 - diag(gamma) (errata)."""
    Gamma = np.eye(order + 1, k=1) - np.diag(gamma)
    rows = [np.eye(order + 1)[0]]
    for _ in range(order):
        rows.append(product(rows[-1], Gamma))
    return np.stack(rows)
