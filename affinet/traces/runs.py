"""Runs in sequences: bursts of losses, and the gaps between them."""

from __future__ import annotations

import numpy as np

from analysis.models.arrays import Integers, Mask


def lengths(held: Mask) -> tuple[Integers, Integers]:
    """The lengths of the runs in which something holds, in each of sequences (B, n), and to which each belongs, (m,) each."""
    edge = np.zeros((len(held), 1), dtype=bool)
    padded = np.concatenate([edge, held, edge], axis=1)
    turns = padded[:, 1:] != padded[:, :-1]
    row, at = np.nonzero(turns)
    return np.asarray(at[1::2] - at[::2], dtype=np.int64), np.asarray(row[::2], dtype=np.int64)
