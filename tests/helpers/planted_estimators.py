"""Estimators of which it is known what they are worth: a good one, and others that are wrong each in a way of its own."""

PLANTED = '''
from dataclasses import dataclass, replace

import numpy as np

from affinet import Estimate, Field, Wants, no_indicator
from agents.estimators.none import NoEstimator
from agents.estimators.rkf import RelativeKalmanFilter


@dataclass(frozen=True)
class Good(RelativeKalmanFilter):
    """Filters, and predicts what is lost."""


@dataclass(frozen=True)
class Truthful(NoEstimator):
    """The measurements, with the covariance that they have: what is lost is not there, and nothing makes up for it."""


@dataclass(frozen=True)
class Overconfident(NoEstimator):
    """Takes its measurements to be better than they are: a fifth of the variance is missing."""

    def fuse(self, brief, state, heard, own):
        state, estimate = super().fuse(brief, state, heard, own)
        return state, estimate._replace(covariance=0.8 * estimate.covariance)


@dataclass(frozen=True)
class Leaking(NoEstimator):
    """Is told where it is, tells its neighbours, and estimates from that what it should measure."""

    wants = Wants(position=True)

    def channels(self, brief):
        return {"place": {"position": Field((brief.dimension,))}}

    def init(self, brief, batch):
        return np.zeros((*batch, brief.dimension))

    def sense(self, brief, state, measured, seen):
        return state, {"place": {"position": state}}

    def fuse(self, brief, state, heard, own):
        told = heard["place"]
        # What neighbours say is of the tick before, and so is what it takes of itself.
        relative = state[..., None, :] - told.fields["position"]
        known = told.fresh & (np.asarray(own.tick) > 0)[..., None]  # in the first tick nobody has been told anything
        return np.array(own.position), Estimate(relative, known, brief.sensor.spread(relative), no_indicator(known))
'''


def write(folder):
    """The module of all of them in a folder."""
    (folder / "planted_here.py").write_text(PLANTED, encoding="utf-8")
    return "planted_here"
