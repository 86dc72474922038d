"""What agents do, read from the wire: every act is checked against the swarm it is in, and a wrong one names its agent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from analysis.models.arrays import Array, Mask
from netem.core.links import Links
from netem.wire import messages
from netem.wire.keys import Keys
from netem.wire.sequence import Sequences


class Beliefs(NamedTuple):
    """What all agents believe of their edges, 0 where nobody said anything: estimates (N, n, D), known (N, n), covariances."""

    estimate: Array
    known: Mask
    covariance: Array


class Acts:
    """Reads the acts of a run.

    Parameters
    ----------
    keys, links, dimension
        Of the run.
    reports
        What estimators report beyond edges, by name, and the shape of each for one agent.
    """

    def __init__(self, keys: Keys, links: Links, dimension: int, reports: Mapping[str, tuple[int, ...]]) -> None:
        self._speaking = {keys.act(agent): agent for agent in range(1, links.agents + 1)}
        self._degree = links.present.sum(axis=1).tolist()
        self._shape = links.present.shape
        self._rows = {"estimate": dimension, "covariance": dimension * (dimension + 1) // 2}
        self._dimension = dimension
        self._reports = reports
        self._streams = Sequences("agent")
        fields = ("input", "known", "estimate", "covariance")
        self._whose = {
            agent: {name: f"agent {agent}: Act: {name}" for name in fields} for agent in range(1, links.agents + 1)
        }

    def restart(self, agent: int) -> None:
        """Expect the acts of a new process."""
        self._streams.restart(f"{agent} act")

    def read(self, key: str, data: bytes, tick: int, awaited: Iterable[int]) -> messages.Act:
        """The act that came on a key, its numbers as arrays.

        Parameters
        ----------
        key, data
            As it came.
        tick
            In which the world is.
        awaited
            Agents whose act is to come.

        Raises
        ------
        WireError
            When it is none, or not one of this tick, or not of an agent whose act is `awaited`.
        UninstructedLoss
            When one before it is missing.
        """
        agent = self._speaking[key]
        try:
            act = messages.unpack(messages.Act, data)
        except messages.WireError as error:
            raise messages.WireError(f"agent {agent}: {error}") from error
        if act.src != agent or act.k != tick or agent not in awaited:
            raise messages.WireError(f"agent {agent} in tick {tick}: agent {act.src} acts in tick {act.k}")
        self._streams.check(f"{agent} act", act.seq)
        return replace(
            act,
            input=messages.numbers(act.input, self._whose[agent]["input"], (self._dimension,)),
            known=self._edges(agent, "known", act.known, (None,), "b"),
            estimate=self._edges(agent, "estimate", act.estimate, (None, self._rows["estimate"])),
            covariance=self._edges(agent, "covariance", act.covariance, (None, self._rows["covariance"])),
            reports={
                name: messages.numbers(act.reports[name], f"agent {agent}: Act: reports: {name}", shape, "iufb")
                for name, shape in self._reports.items()
                if name in act.reports
            },
        )

    def beliefs(self, acts: Mapping[int, messages.Act]) -> Beliefs:
        """What all agents believe, padded to the widest."""
        believed = Beliefs(
            np.zeros((*self._shape, self._rows["estimate"])),
            np.zeros(self._shape, dtype=bool),
            np.zeros((*self._shape, self._rows["covariance"])),
        )
        for agent, act in acts.items():
            for everybody, own in zip(believed, (act.estimate, act.known, act.covariance), strict=True):
                everybody[agent - 1, : len(own)] = own
        return believed

    def _edges(self, agent: int, name: str, given: Any, shape: tuple[int | None, ...], kinds: str = "iuf") -> Any:
        rows = messages.numbers(given, self._whose[agent][name], shape, kinds)
        if len(rows) not in (0, self._degree[agent - 1]):
            raise messages.WireError(
                f"agent {agent}: Act: {name}: expected one for each of its {self._degree[agent - 1]} neighbours, or none, "
                f"got {len(rows)} (see docs/protocol.md)"
            )
        return rows
