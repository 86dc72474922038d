"""Requested against achieved: rows of the accuracy table, each tested at a threshold that is fixed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.models.arrays import Array, Integers

SIGMAS = 3.0  # of a mean or a share: an interval of 99.73 %
SIGMAS_OF_MANY = 4.0  # of correlations, of which there are many
UNLIKELY = 0.001  # p of a distribution
_NINE_OF_TEN = 1.2816  # standard deviations
_FEWEST = 5  # expected in a bin of chi-square
_FEWEST_DEPENDENT = 50  # in a bin whose variance is estimated


@dataclass(frozen=True)
class Row:
    """A line of the table.

    Parameters
    ----------
    model, parameters, what, requested, achieved
        In words.
    interval
        In which what was achieved has its true value, with 99.73 %: of three standard deviations.
    evidence
        z, p, or that it is exact.
    ok
        Whether it is what was requested.
    chance
        That a right model is not ok.
    found
        How far off, in parts of what was requested, a model is that is not ok in nine of ten runs.
    file
        From which the figure comes.
    """

    model: str
    parameters: str
    what: str
    requested: str
    achieved: str
    interval: str
    evidence: str
    ok: bool
    chance: float = 0.0
    found: str = ""
    file: str = ""

    def __str__(self) -> str:
        told = (self.model, self.parameters, self.what, self.requested, self.achieved, self.interval, self.evidence)
        return f"| {' | '.join((*told, self.found, self.file))} | {'ok' if self.ok else '**NOT OK**'} |"


@dataclass(frozen=True)
class Against:
    """What one model was asked for, to be held against what it did, of which a file tells."""

    model: str
    parameters: str
    file: str = ""

    def share(self, what: str, requested: float, achieved: NDArray[np.bool_]) -> Row:
        """The share of independent events that are true: binomial, the interval that of Clopper and Pearson."""
        spread = (requested * (1.0 - requested) / achieved.size) ** 0.5
        test = stats.binomtest(int(achieved.sum()), achieved.size)
        low, high = test.proportion_ci(1.0 - _chance(SIGMAS))
        row = self.normal(what, requested, float(achieved.mean()), spread)
        return replace(row, interval=_interval(low, high), ok=bool(low <= requested <= high))

    def shares(self, what: str, requested: Array, hits: Array, trials: Array) -> Row:
        """Many independent shares at once: the sum of their squared z is chi-square."""
        squared = (hits - trials * requested) ** 2 / (trials * requested * (1.0 - requested))
        p = float(stats.chi2.sf(squared.sum(), squared.size))
        error = float(np.mean(hits / trials - requested))
        spread = float((requested * (1.0 - requested) / trials).sum() ** 0.5) / squared.size
        row = self._p(what, f"{squared.size} shares", f"mean error {error:+.2g}", p)
        return replace(row, interval=_interval(error - SIGMAS * spread, error + SIGMAS * spread))

    def mean(self, what: str, requested: float, each: Array) -> Row:
        """The mean of independent values, one per link; their spread is measured."""
        spread = float(each.std(ddof=1)) / len(each) ** 0.5
        return self._measured(what, requested, float(each.mean()), spread, len(each))

    def ratio(self, what: str, requested: float, above: Array, below: Array) -> Row:
        """A mean over a number of things that is itself random, both summed per link."""
        off = above - requested * below
        error = float(off.std(ddof=1)) * len(off) ** 0.5 / float(below.sum())
        return self._measured(what, requested, float(above.sum() / below.sum()), error, len(off))

    def counts(self, what: str, chances: Array, counted: Array | Integers) -> Row:
        """How often each kind of independent event came: chi-square; the last bin takes what `chances` leave to 1."""
        chances, counted = _pooled(chances, counted[None], _FEWEST)
        total = counted.sum()
        p = float(stats.chisquare(counted[0], chances * total).pvalue) if len(chances) > 1 else 1.0
        return self._p(what, f"{len(chances)} bins", f"{total:.0f} counted", p)

    def counts_by_link(self, what: str, chances: Array, counted: Array) -> Row:
        """The same where the events of a link depend on each other, by link (L, bins): Hotelling's T-squared."""
        chances, counted = _pooled(chances, counted, _FEWEST_DEPENDENT)
        links, free = len(counted), len(chances) - 1
        off = (counted - counted.sum(axis=-1, keepdims=True) * chances)[:, :free]
        centre, spread = off.mean(axis=0), np.atleast_2d(np.cov(off, rowvar=False))
        squared = links * centre @ np.linalg.solve(spread, centre)
        p = float(stats.f.sf(squared * (links - free) / (free * (links - 1)), free, links - free))
        return self._p(what, f"{free + 1} bins", f"{counted.sum():.0f} counted", p)

    def standard(self, what: str, z: Array, least: float, most: float) -> Row:
        """Independent numbers by their z, with the least and the largest of them: the sum of the squares is chi-square."""
        p = float(stats.chi2.sf((z * z).sum(), z.size))
        return self._p(what, f"{z.size} links", f"{least:.4g} to {most:.4g}", p)

    def distribution(self, what: str, cdf: Callable[[Array], Array], sample: Array) -> Row:
        """The distribution of independent values: Kolmogorov-Smirnov."""
        distributed: Any = cdf  # the stubs know of functions of one number only
        test = stats.kstest(sample.ravel(), distributed)
        return self._p(what, "its distribution", f"D = {test.statistic:.2g} of {sample.size}", float(test.pvalue))

    def uncorrelated(self, what: str, a: Array, b: Array) -> Row:
        """The correlation of two series of mean 0 and variance 1, each of independent values."""
        return self.normal(what, 0.0, float((a * b).mean()), a.size**-0.5, SIGMAS_OF_MANY)

    def no_pair(self, what: str, z: Array) -> Row:
        """No value of very many standard normal ones is out of the ordinary: Bonferroni."""
        worst = float(np.abs(z).max())
        p = min(1.0, z.size * 2.0 * float(stats.norm.sf(worst)))
        return self._p(what, f"{z.size} pairs", f"max \\|z\\| = {worst:.2f}", p)

    def exactly(self, what: str, requested: float, achieved: float) -> Row:
        """A number that leaves no room for chance."""
        same = achieved == requested
        return replace(self._row(what, f"{requested:.6g}", f"{achieved:.6g}", "exact", same), found="any")

    def judged(self, what: str, requested: str, achieved: str, interval: str, evidence: str, ok: bool) -> Row:
        """What is judged where it is measured."""
        return replace(self._row(what, requested, achieved, evidence, ok), interval=interval)

    def told(self, what: str, achieved: str, interval: str = "") -> Row:
        """What is told, and no more: nothing was asked of it."""
        return replace(self._row(what, "-", achieved, "told", ok=True), interval=interval)

    def within(self, what: str, requested: float, achieved: float, tolerance: float, unit: str) -> Row:
        """A number with a bound."""
        ok = abs(achieved - requested) <= tolerance
        evidence = f"within {tolerance:.2g} {unit}"
        return self._row(what, f"{requested:.6g}", f"{achieved:.6g}", evidence, ok)

    def normal(self, what: str, requested: float, achieved: float, spread: float, most: float = SIGMAS) -> Row:
        """A number of known standard deviation, of which it may be so many away."""
        z = (achieved - requested) / spread
        row = self._row(what, f"{requested:.5g}", f"{achieved:.5g}", f"z = {z:+.2f}", abs(z) < most)
        interval = _interval(achieved - most * spread, achieved + most * spread)
        found = f"{(most + _NINE_OF_TEN) * spread / abs(requested):.2g}" if requested else ""
        return replace(row, interval=interval, chance=_chance(most), found=found)

    def _measured(self, what: str, requested: float, achieved: float, spread: float, size: int) -> Row:
        """A mean of so many numbers whose standard deviation is measured on them: Student's t."""
        most = float(stats.t.isf(stats.norm.sf(SIGMAS), size - 1))
        return replace(self.normal(what, requested, achieved, spread, most), chance=_chance(SIGMAS))

    def _p(self, what: str, requested: str, achieved: str, p: float) -> Row:
        return replace(self._row(what, requested, achieved, f"p = {p:.3f}", p > UNLIKELY), chance=UNLIKELY)

    def _row(self, what: str, requested: str, achieved: str, evidence: str, ok: bool) -> Row:
        return Row(self.model, self.parameters, what, requested, achieved, "", evidence, bool(ok), file=self.file)


def _chance(sigmas: float) -> float:
    return 2.0 * float(stats.norm.sf(sigmas))


def _interval(low: float, high: float) -> str:
    return f"{low:.5g} to {high:.5g}"


def _pooled(chances: Array, counted: Array | Integers, fewest: int) -> tuple[Array, Array]:
    """Neighbouring bins in one until enough is expected in each; counts by row (rows, bins), the last bin open."""
    chances = np.append(chances, max(0.0, 1.0 - chances.sum()))[: counted.shape[-1]]
    expected, starts, held = chances * counted.sum(), [0], 0.0
    for n, value in enumerate(expected[:-1]):
        held += value
        if held >= fewest and expected[n + 1 :].sum() >= fewest:
            starts.append(n + 1)
            held = 0.0
    return np.add.reduceat(chances, starts), np.add.reduceat(counted, starts, axis=-1).astype(np.float64)
