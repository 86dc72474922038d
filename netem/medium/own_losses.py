"""What losses of a user's own hold in a tick."""

from __future__ import annotations

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.draws import DrawnAhead, Seed, uniform
from netem.core.links import Links
from netem.impairments.own import Loss, Offered, OwnLoss
from netem.loading.calling import Calling
from netem.loading.given import readonly
from netem.loading.returned import BOOL, array
from netem.processes.user_code import in_tick


class OwnLosses:
    """A loss on its links.

    Parameters
    ----------
    seed
        Of the run.
    links, dt
        Of the run; a tick in seconds.
    own
        The loss.
    codes
        The channels' words in the counters of draws, shape (C',).

    Raises
    ------
    UserCodeError
        When it cannot be made, or, by `lost`, when it fails or returns something else than what is lost.
    """

    def __init__(self, seed: Seed, links: Links, dt: float, own: OwnLoss, codes: Integers) -> None:
        self._loss: Loss = own.choice.build()
        self._by_position, self._dt = own.by_position, dt
        self._shape = (len(codes), len(links))
        self._rows = np.flatnonzero(own.rows)
        self._sender, self._receiver = links.src[self._rows] - 1, links.dst[self._rows] - 1
        self._ends = {name: numbers[self._rows] for name, numbers in links.ends.items()}
        of_links, lanes = links.seeds(seed), self._loss.draws
        seeds = of_links if isinstance(of_links, int) else of_links[self._rows]

        def draw(ticks: Integers) -> Array:
            if not lanes:
                return np.empty((len(ticks), len(codes), len(self._rows), 0))
            index = {"tick": ticks[:, None, None], "channel": codes[:, None], **self._ends}
            return uniform(seeds, own.purpose, **index, lanes=lanes)

        self._draws = DrawnAhead(draw)

    def lost(self, tick: int, position: Array | None) -> Mask:
        """True where it loses what is offered in a tick, shape (C', L), when agents are at these positions (N, D)."""
        relative = None
        if self._by_position and position is not None:
            relative = position[self._sender] - position[self._receiver]
        offered = Offered(tick, tick * self._dt, self._ends["src"], self._ends["dst"], self._draws.at(tick), relative)
        with in_tick(tick), Calling(self._loss, "lost"):
            lost = self._loss.lost(readonly(offered))
            array("what is lost", lost, "C, n", (self._shape[0], len(self._rows)), (), BOOL)
        held = np.zeros(self._shape, dtype=bool)
        held[:, self._rows] = lost
        return held
