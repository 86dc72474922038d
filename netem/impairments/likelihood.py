"""How probable a chain makes a sequence of messages that were lost or passed."""

from __future__ import annotations

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import log
from netem.impairments.chain import Chain


def log_likelihood(chain: Chain, lost: Mask) -> float:
    """The logarithm of the probability of a sequence (n,), one step to a message, from the stationary distribution on.

    By the forward recursion of hidden Markov models (Rabiner 1989), scaled in each step.
    """
    return float(log(predicted(chain, lost)).sum())


def predicted(chain: Chain, lost: Mask) -> Array:
    """How probable what became of each message was, given those before it, shape (n,)."""
    probable: Array = _predicted(chain.transition, chain.loss, chain.stationary, lost)[0]
    return probable


@kernel("(s,s),(s),(s),(n)->(n),(s),(s)", "ddd?->ddd")
def _predicted() -> Plain:
    def plain(
        transition: Array, loss: Array, start: Array, lost: Mask, probable: Array, state: Array, following: Array
    ) -> None:
        states = len(loss)
        for one in range(states):
            state[one] = start[one]
        for n in range(len(lost)):
            total = 0.0
            for one in range(states):
                state[one] *= loss[one] if lost[n] else 1.0 - loss[one]
                total += state[one]
            probable[n] = total
            for other in range(states):
                following[other] = 0.0
            if total > 0.0:
                for one in range(states):
                    for other in range(states):
                        following[other] += state[one] / total * transition[one, other]
            for other in range(states):
                state[other] = following[other]

    return plain
