"""The accounts of a run's messages, which must close."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.models.arrays import Integers
from netem.medium.verdict import REASONS, Verdict, VerdictCodes

Counts = Integers


@dataclass(frozen=True)
class Ledger:
    """Every message accounted for: offered + copies = delivered + dropped + in flight."""

    offered: int
    copies: int
    delivered: int
    dropped: dict[str, int]

    @classmethod
    def of(cls, verdicts: VerdictCodes, copies: Counts, late: Counts, dropped: Counts) -> Ledger:
        """The accounts of a run.

        Parameters
        ----------
        verdicts
            Verdicts on what was offered, shape (ticks, C, L).
        copies
            Duplicates made in each tick, shape (ticks,).
        late
            Messages and copies that each tick delivered from under way, shape (ticks,).
        dropped
            Messages under way that each tick dropped, by verdict, shape (ticks, verdicts).
        """
        offered = np.bincount(verdicts.ravel(), minlength=len(Verdict))
        lost = offered + dropped.sum(axis=0)
        return cls(
            offered=int(offered.sum() - offered[Verdict.SILENT]),
            copies=int(copies.sum()),
            delivered=int(offered[Verdict.DELIVERED] + late.sum()),
            dropped={reason.label: int(lost[reason]) for reason in REASONS if lost[reason]},
        )

    def plus(self, other: Ledger) -> Ledger:
        """The accounts of both, one after the other."""
        return Ledger(
            offered=self.offered + other.offered,
            copies=self.copies + other.copies,
            delivered=self.delivered + other.delivered,
            dropped={
                reason.label: total
                for reason in REASONS
                if (total := self.dropped.get(reason.label, 0) + other.dropped.get(reason.label, 0))
            },
        )


@dataclass(frozen=True)
class Accounts:
    """How far a run came, and what became of its messages.

    Parameters
    ----------
    ticks
        That are accounted for.
    ledger
        What became of the messages offered in them.
    in_flight
        Messages under way after them.
    """

    ticks: int
    ledger: Ledger
    in_flight: int

    @property
    def accounted_for(self) -> int:
        """Messages of which it is known what became of them."""
        return self.ledger.delivered + sum(self.ledger.dropped.values()) + self.in_flight

    @property
    def close(self) -> bool:
        """Whether that is every message, and every copy."""
        return self.ledger.offered + self.ledger.copies == self.accounted_for


NOTHING = Accounts(0, Ledger(offered=0, copies=0, delivered=0, dropped={}), 0)
