"""Chains fitted to sequences of messages, with intervals: by counting where that is exact, or by maximum likelihood."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize, stats
from scipy.special import expit, logit

from analysis.models.arrays import Array, Mask
from netem.impairments import loss
from netem.impairments.chain import Chain
from netem.impairments.likelihood import log_likelihood

CONFIDENCE = 0.95
MODELS = ("bernoulli", "gilbert", "gilbert-elliott", "markov")
_DROP = float(stats.chi2.ppf(CONFIDENCE, 1)) / 2.0  # of the log-likelihood, at the ends of an interval
_FARTHEST = 12.0  # logits of probabilities: 6e-6 to 1 - 6e-6
_STRIDE = 0.3  # logits
_BETWEEN = 3  # looks for an end of an interval, once it is bracketed
_OUT_OF_ORDER = 1e3  # what it costs for each squared logit


class NotFitted(ValueError):
    """Why no chain can be fitted, and the way out."""


class Interval(NamedTuple):
    """A parameter, and between what it lies with a confidence of 95 %."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Fit:
    """A chain fitted to sequences.

    Parameters
    ----------
    model
        As a profile calls it.
    parameters
        As a profile has them.
    log_likelihood, bic
        Of the sequences; of the fits to the same ones that with the least BIC is to be preferred.
    chain
        With these parameters.
    """

    model: str
    parameters: Mapping[str, Interval]
    log_likelihood: float
    bic: float
    chain: Chain


class _Hidden(NamedTuple):
    """A chain whose states are hidden.

    Parameters
    ----------
    names
        Of its parameters.
    build
        The chain of them.
    starts
        Where to look from.
    leaving
        Pairs of parameters whose sum is at most 1.
    ordered
        Pairs of which the first is the larger: else states could take each other's names.
    """

    names: tuple[str, ...]
    build: Callable[..., Chain]
    starts: Sequence[tuple[float, ...]]
    leaving: Sequence[tuple[int, ...]] = ()
    ordered: Sequence[tuple[int, int]] = ()


_GILBERT_ELLIOTT = _Hidden(
    ("p", "r", "bad", "good"),
    loss.gilbert_elliott,
    ((0.05, 0.2, 0.9, 0.02), (0.01, 0.05, 0.5, 0.05), (0.2, 0.5, 0.7, 0.1), (0.005, 0.02, 0.3, 0.01)),
    ordered=((2, 3),),
)
_MARKOV = _Hidden(
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
        Of what is counted the intervals are Clopper and Pearson's; of the others they are where the likelihood, at its
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
    p = _share(lost, of)
    return _fitted("bernoulli", {"p": p}, loss.bernoulli(p.value), sequences)


def _gilbert(sequences: Sequence[Mask], _: bool) -> Fit:
    begins = np.sum([(~one[:-1] & one[1:]).sum() for one in sequences])
    ends = np.sum([(one[:-1] & ~one[1:]).sum() for one in sequences])
    good = np.sum([(~one[:-1]).sum() for one in sequences])
    bad = np.sum([one[:-1].sum() for one in sequences])
    if not begins or not ends:
        raise NotFitted("no burst of losses begins and ends in it: take a longer log, or fit bernoulli")
    p, r = _share(int(begins), int(good)), _share(int(ends), int(bad))
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

    scaled = {
        name: Interval(*(min(1.0, one * of(at.value) / at.value) for one in at)) if name in "pr" else at
        for name, at in fit.parameters.items()
    }
    return Fit(fit.model, scaled, fit.log_likelihood, fit.bic, _chain(scaled))


def _chain(parameters: Mapping[str, Interval]) -> Chain:
    return loss.gilbert_elliott(**{name: one.value for name, one in parameters.items()})


def _losses(sequences: Sequence[Mask]) -> tuple[int, int]:
    return int(np.sum([one.sum() for one in sequences])), int(np.sum([len(one) for one in sequences]))


def _share(hits: int, of: int) -> Interval:
    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(stats.beta.ppf(tail, hits, of - hits + 1)) if hits else 0.0
    high = float(stats.beta.ppf(1.0 - tail, hits + 1, of - hits)) if hits < of else 1.0
    return Interval(hits / of, low, high)


def _fitted(model: str, parameters: Mapping[str, Interval], chain: Chain, sequences: Sequence[Mask]) -> Fit:
    total = float(np.sum([log_likelihood(chain, one) for one in sequences]))
    messages = np.sum([len(one) for one in sequences])
    return Fit(model, parameters, total, float(len(parameters) * np.log(messages) - 2.0 * total), chain)


def _maximal(model: str, hidden: _Hidden, sequences: Sequence[Mask], sure: bool) -> Fit:
    """The chain of the highest likelihood; its intervals only where one wants to be sure, as they take their time."""
    found = [_lowest(_cost(hidden, sequences), _logits(hidden, start), None) for start in hidden.starts]
    lowest = min(found, key=lambda one: one.cost)
    chances = _inside(hidden, lowest.at)
    parameters = {}
    for place, name in enumerate(hidden.names):
        led = hidden._replace(leaving=tuple(pair[::-1] if pair[1] == place else pair for pair in hidden.leaving))
        there = _Lowest(_logits(led, chances.tolist()), lowest.cost)
        ends = _ends(led, _cost(led, sequences), there, place) if sure else (np.nan, np.nan)
        parameters[name] = Interval(float(chances[place]), *ends)
    return _fitted(model, parameters, hidden.build(*chances.tolist()), sequences)


def _cost(hidden: _Hidden, sequences: Sequence[Mask]) -> Callable[[Array], float]:
    def cost(at: Array) -> float:
        chain = hidden.build(*_inside(hidden, at).tolist())
        disorder = sum(max(0.0, float(at[less] - at[more])) for more, less in hidden.ordered)
        return _OUT_OF_ORDER * disorder * disorder - sum(log_likelihood(chain, one) for one in sequences)

    return cost


class _Lowest(NamedTuple):
    at: Array
    cost: float


def _lowest(cost: Callable[[Array], float], start: Array, fixed: int | None) -> _Lowest:
    """The least cost about a start, where one coordinate may stay what it is."""
    free = np.arange(len(start)) != (-1 if fixed is None else fixed)

    def at(given: Array) -> Array:
        whole = start.copy()
        whole[free] = given
        return whole

    def cost_at(given: Any) -> float:
        return cost(at(given))

    inside = np.clip(start[free], -_FARTHEST, _FARTHEST).tolist()
    found = optimize.minimize(
        cost_at, np.array(inside), method="L-BFGS-B", bounds=optimize.Bounds(-_FARTHEST, _FARTHEST)
    )
    return _Lowest(at(found.x), float(found.fun))


def _ends(hidden: _Hidden, cost: Callable[[Array], float], best: _Lowest, place: int) -> tuple[float, float]:
    """Between what a parameter lies: where the likelihood, at its highest over the others, has dropped by so much."""
    low, high = (_end(cost, best, place, way) for way in (-1.0, 1.0))
    return (
        0.0 if low is None else float(_inside(hidden, low)[place]),
        1.0 if high is None else float(_inside(hidden, high)[place]),
    )


def _end(cost: Callable[[Array], float], best: _Lowest, place: int, way: float) -> Array | None:
    """One end, None where the likelihood never drops: outwards in growing strides, then between by regula falsi.

    The square root of the drop is all but straight.
    """

    def beyond(near: Array, value: float) -> tuple[float, Array]:
        start = near.copy()
        start[place] = value
        there = _lowest(cost, start, place)
        return float(np.sqrt(max(0.0, there.cost - best.cost)) - np.sqrt(_DROP)), there.at

    inside, (below, near), stride = float(best.at[place]), (-float(np.sqrt(_DROP)), best.at), way * _STRIDE
    while True:
        outside = float(np.clip(inside + stride, -_FARTHEST, _FARTHEST))
        above, at = beyond(near, outside)
        if above > 0.0:
            break
        if abs(outside) >= _FARTHEST:
            return None
        inside, below, near, stride = outside, above, at, 2.0 * stride
    for _ in range(_BETWEEN):
        middle = inside - below * (outside - inside) / (above - below)
        there, at = beyond(near, middle)
        if there > 0.0:
            outside, above = middle, there
        else:
            inside, below, near = middle, there, at
    found = near.copy()
    found[place] = inside - below * (outside - inside) / (above - below)
    return found


def _inside(hidden: _Hidden, at: Array) -> Array:
    """Probabilities from any numbers: logistic, and of two that share a state the second is of what the first leaves."""
    chances = np.asarray(expit(at), dtype=np.float64)
    for first, second in hidden.leaving:
        chances[second] *= 1.0 - chances[first]
    return chances


def _logits(hidden: _Hidden, chances: Sequence[float]) -> Array:
    of = np.array(chances)
    for first, second in hidden.leaving:
        of[second] /= max(1.0 - of[first], 1e-12)
    return np.clip(np.asarray(logit(np.clip(of, 0.0, 1.0)), dtype=np.float64), -_FARTHEST, _FARTHEST)


_MODELS: Mapping[str, Callable[[Sequence[Mask], bool], Fit]] = {
    "bernoulli": _bernoulli,
    "gilbert": _gilbert,
    "gilbert-elliott": partial(_maximal, "gilbert-elliott", _GILBERT_ELLIOTT),
    "markov": partial(_maximal, "markov", _MARKOV),
}
