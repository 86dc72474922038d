"""Chains fitted to sequences of messages, with intervals: by counting where that is exact, or by maximum likelihood."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy import optimize, stats

from affinet.traces import runs
from affinet.traces.maximum import CONFIDENCE, Hidden, Interval, maximal
from analysis.models.arrays import Mask
from netem.impairments import loss
from netem.impairments.chain import Chain
from netem.impairments.likelihood import log_likelihood

FEW = 10  # bursts of losses: below, intervals are wide, and no fit can be told from another
MODELS = ("bernoulli", "gilbert", "gilbert-elliott", "markov")


class NotFitted(ValueError):
    """Why no chain can be fitted, and the way out."""


@dataclass(frozen=True)
class Fit:
    """A chain fitted to sequences.

    Parameters
    ----------
    model
        As a profile calls it.
    parameters
        As a profile has them.
    messages, bursts
        How many there were, and how many bursts of losses in them.
    log_likelihood, bic
        Of the sequences; of the fits to the same ones that with the least BIC is to be preferred.
    chain
        With these parameters.
    """

    model: str
    parameters: Mapping[str, Interval]
    messages: int
    bursts: int
    log_likelihood: float
    bic: float
    chain: Chain

    @property
    def few(self) -> bool:
        """Whether there was too little to fit to."""
        return self.bursts < FEW


_GILBERT_ELLIOTT = Hidden(
    ("p", "r", "bad", "good"),
    loss.gilbert_elliott,
    ((0.05, 0.2, 0.9, 0.02), (0.01, 0.05, 0.5, 0.05), (0.2, 0.5, 0.7, 0.1), (0.005, 0.02, 0.3, 0.01)),
    ordered=((2, 3),),
)
_MARKOV = Hidden(
    ("p13", "p31", "p32", "p23", "p14"),
    loss.markov,
    ((0.02, 0.2, 0.2, 0.5, 0.01), (0.05, 0.4, 0.1, 0.3, 0.005), (0.01, 0.1, 0.4, 0.8, 0.02)),
    leaving=((0, 4), (1, 2)),
)


def fitted(model: str, sequences: Sequence[Mask]) -> Fit:
    """A model fitted to sequences of messages, lost or not, shape (n,) each, all of one chain.

    Parameters
    ----------
    model
        One of `MODELS`: `bernoulli`, independent losses; `gilbert`, good periods without a loss and bad ones with nothing
        else, by counting what followed what; `gilbert-elliott` and `markov`, netem's four states, by maximum likelihood.
        Of what is counted the intervals are Clopper and Pearson's, their low ends given that it was seen at all, as nothing
        is fitted else; of the others they are where the likelihood, at its
        highest over all other parameters, has dropped by what a chi-square of one degree exceeds in 5 %.
    sequences
        Which.

    Raises
    ------
    NotFitted
        When they do not tell enough.
    """
    _refuse_too_little(sequences)
    return _MODELS[model](sequences, True)


def best(sequences: Sequence[Mask]) -> tuple[Fit, Mapping[str, float]]:
    """The model of the least BIC, and the BIC of each that can be fitted.

    Raises
    ------
    NotFitted
        When they do not tell enough.
    """
    _refuse_too_little(sequences)
    found: dict[str, float] = {}
    for name, model in _MODELS.items():
        with suppress(NotFitted):
            found[name] = model(sequences, False).bic
    return _MODELS[min(found, key=lambda name: found[name])](sequences, True), found


def _bernoulli(sequences: Sequence[Mask], _: bool) -> Fit:
    lost, of = _losses(sequences)
    p = _seen(lost, of)
    return _fitted("bernoulli", {"p": p}, loss.bernoulli(p.value), sequences)


def _gilbert(sequences: Sequence[Mask], _: bool) -> Fit:
    begins = np.sum([(~one[:-1] & one[1:]).sum() for one in sequences])
    ends = np.sum([(one[:-1] & ~one[1:]).sum() for one in sequences])
    good = np.sum([(~one[:-1]).sum() for one in sequences])
    bad = np.sum([one[:-1].sum() for one in sequences])
    if not begins or not ends:
        raise NotFitted("no burst of losses begins and ends in it: take a longer log, or fit bernoulli")
    p, r = _seen(int(begins), int(good)), _seen(int(ends), int(bad))
    return _fitted("gilbert-elliott", {"p": p, "r": r}, loss.gilbert_elliott(p.value, r.value), sequences)


def _refuse_too_little(sequences: Sequence[Mask]) -> None:
    """Go on if something was lost and something passed.

    Raises
    ------
    NotFitted
        If not, with what can be said all the same.
    """
    lost, of = _losses(sequences)
    if not lost or lost == of:
        share = _share(lost, of)
        worth = f"at most {share.high:.2g}" if not lost else f"at least {share.low:.2g}"
        what = "nothing" if not lost else "everything"
        raise NotFitted(
            f"{what} was lost of {of} messages: the loss is {worth} (95 %), and more is not known: take more"
        )


def in_steps_of(fit: Fit, share: float) -> Fit:
    """The same process in steps of a share of those it was fitted in: it keeps its loss, and how long periods last.

    Raises
    ------
    NotFitted
        Where there is none, as of a chain whose states change more often than they would by chance.
    """
    if fit.model == "bernoulli" or share == 1.0:
        return fit
    if fit.model == "markov":
        raise NotFitted(
            "a chain of four states is of the steps it was fitted in: leave out --dt, or fit gilbert-elliott"
        )
    p, r = fit.parameters["p"].value, fit.parameters["r"].value
    stays = 1.0 - p - r
    if stays <= 0.0:
        raise NotFitted("good and bad follow each other too closely for any other step: leave out --dt")

    def of(value: float) -> float:
        return value / (p + r) * (1.0 - stays**share)

    scaled = {name: _in_proportion(at, of(at.value)) if name in "pr" else at for name, at in fit.parameters.items()}
    return replace(fit, parameters=scaled, chain=_chain(scaled))


def _in_proportion(at: Interval, value: float) -> Interval:
    """Another value, and its interval in proportion; where nothing is known, nothing is."""
    if (at.low, at.high) == (0.0, 1.0):
        return Interval(value, *at[1:])
    return Interval(*(min(1.0, one * value / at.value) for one in at))


def _chain(parameters: Mapping[str, Interval]) -> Chain:
    return loss.gilbert_elliott(**{name: one.value for name, one in parameters.items()})


def _losses(sequences: Sequence[Mask]) -> tuple[int, int]:
    return int(np.sum([one.sum() for one in sequences])), int(np.sum([len(one) for one in sequences]))


def _share(hits: int, of: int) -> Interval:
    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(stats.beta.ppf(tail, hits, of - hits + 1)) if hits else 0.0
    high = float(stats.beta.ppf(1.0 - tail, hits + 1, of - hits)) if hits < of else 1.0
    return Interval(hits / of, low, high)


def _seen(hits: int, of: int) -> Interval:
    """The share of something that was seen: had it never been, no share would be asked for, and its low end knows that."""
    share, tail = _share(hits, of), (1.0 - CONFIDENCE) / 2.0

    def beyond(chance: float) -> float:
        seen = stats.binom.sf(0, of, chance)
        return float(stats.binom.sf(hits - 1, of, chance) / seen) - tail

    least = 1e-12
    low = 0.0 if beyond(least) >= 0.0 else float(optimize.brentq(beyond, least, share.value))
    return share._replace(low=low)


def _fitted(model: str, parameters: Mapping[str, Interval], chain: Chain, sequences: Sequence[Mask]) -> Fit:
    total = float(np.sum([log_likelihood(chain, one) for one in sequences]))
    messages = int(np.sum([len(one) for one in sequences]))
    bursts = int(np.sum([len(runs.lengths(one[None])[0]) for one in sequences]))
    bic = float(len(parameters) * np.log(messages) - 2.0 * total)
    return Fit(model, parameters, messages, bursts, total, bic, chain)


def _maximal(model: str, hidden: Hidden, sequences: Sequence[Mask], sure: bool) -> Fit:
    parameters = maximal(hidden, sequences, sure=sure)
    return _fitted(model, parameters, hidden.build(*(one.value for one in parameters.values())), sequences)


_MODELS: Mapping[str, Callable[[Sequence[Mask], bool], Fit]] = {
    "bernoulli": _bernoulli,
    "gilbert": _gilbert,
    "gilbert-elliott": partial(_maximal, "gilbert-elliott", _GILBERT_ELLIOTT),
    "markov": partial(_maximal, "markov", _MARKOV),
}
