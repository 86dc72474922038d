"""An agent's last state on disk, from which a process that takes its place goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from analysis.models.arrays import Array
from netem.processes.whole import whole


def save(path: Path, state: Any) -> None:
    """Write a state, whole or not at all: the process may be killed while it writes."""
    with whole(path) as unfinished:
        np.savez(unfinished, *_leaves(state), allow_pickle=False)


def load(path: Path, like: Any) -> Any:
    """The state in a file, with the structure of another state of the same agent.

    Raises
    ------
    FileNotFoundError
        When the agent never wrote one.
    """
    with np.load(path, allow_pickle=False) as archive:
        leaves = [archive[name] for name in archive.files]
    return _filled(like, iter(leaves))


def _leaves(state: Any) -> list[Array]:
    if isinstance(state, tuple):
        return [leaf for part in state for leaf in _leaves(part)]
    return [np.asarray(state)]


def _filled(like: Any, leaves: Any) -> Any:
    if isinstance(like, tuple):
        return type(like)(*(_filled(part, leaves) for part in like))
    return next(leaves)
