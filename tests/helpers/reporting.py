"""An estimator that a scenario can name, whose reports are of any name."""

from dataclasses import dataclass

import numpy as np

from agents.estimators.none import NoEstimator


@dataclass(frozen=True)
class Reporting(NoEstimator):
    """Says something under a name that is given."""

    name: str = "said"

    def fuse(self, brief, state, heard, own):
        state, estimate = super().fuse(brief, state, heard, own)
        batch = estimate.known.shape[:-1]
        number = np.arange(np.prod(batch, dtype=int) * 3.0).reshape(*batch, 3)
        return state, estimate._replace(reports={self.name: number})
