"""What agents do, read from the wire: every act is checked against the swarm it is in, and a wrong one names its agent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import prod
from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Array, Mask
from netem.core.links import Links
from netem.wire import messages
from netem.wire.arrays import FLOAT, TRUTH, Form, WireError, joined, numbers, packed
from netem.wire.keys import Keys
from netem.wire.sequence import Sequences


class Done(NamedTuple):
    """What all agents did and believe, 0 of those who said nothing.

    Parameters
    ----------
    input
        What they steer, shape (N, D).
    estimate, known, covariance
        What they believe of their edges, shapes (N, n, D), (N, n) and (N, n, D (D + 1) / 2).
    reports
        What else their estimators say, by name, shape (N, *), NaN of those who said nothing.
    """

    input: Array
    estimate: Array
    known: Mask
    covariance: Array
    reports: Mapping[str, Array]


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
        self._present = links.present
        self._input = Form((dimension,), truths=False)
        # What an agent believes of an edge: the shape, what it holds, and how many bytes there are of each agent.
        self._edges = {
            name: (shape, dtype, [degree * prod(shape) * dtype.itemsize for degree in self._degree])
            for name, shape, dtype in (
                ("estimate", (dimension,), FLOAT),
                ("known", (), TRUTH),
                ("covariance", (dimension * (dimension + 1) // 2,), FLOAT),
            )
        }
        self._reports = {name: Form(shape, truths=False) for name, shape in reports.items()}
        self._unsaid = [packed(np.full(shape, np.nan)) for shape in reports.values()]
        self._streams = Sequences("agent")
        self._stream = {agent: f"{agent} act" for agent in self._speaking.values()}
        fields = ("input", "reports", *self._edges)
        self._whose = {name: [f"agent {agent}: Act: {name}" for agent in self._stream] for name in fields}

    def restart(self, agent: int) -> None:
        """Expect the acts of a new process."""
        self._streams.restart(self._stream[agent])

    def read(self, key: str, data: bytes, tick: int, awaited: Iterable[int]) -> messages.Act:
        """The act that came on a key.

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
        agent, act = self._unpacked(key, data)
        if act.src != agent or act.k != tick or agent not in awaited:
            raise WireError(f"agent {agent} in tick {tick}: agent {act.src} acts in tick {act.k}")
        self._streams.check(self._stream[agent], act.seq)
        return act

    def read_when_it_comes(self, key: str, data: bytes, tick: int) -> messages.Act:
        """The act that came on a key in this tick, in which or in an earlier one it was decided.

        Raises
        ------
        WireError
            When it is none, or one of a tick that is yet to come.
        UninstructedLoss
            When one before it is missing.
        """
        agent, act = self._unpacked(key, data)
        if act.src != agent or not 0 <= act.k <= tick:
            raise WireError(f"agent {agent} in tick {tick}: agent {act.src} acts in tick {act.k}")
        self._streams.check(self._stream[agent], act.seq)
        return act

    def _unpacked(self, key: str, data: bytes) -> tuple[int, messages.Act]:
        agent = self._speaking[key]
        try:
            return agent, messages.unpack(messages.Act, data)
        except WireError as error:
            raise WireError(f"agent {agent}: {error}") from error

    def together(self, acts: Mapping[int, messages.Act]) -> Done:
        """What the acts of a tick say, by number of the agent, as arrays of all.

        Raises
        ------
        WireError
            When one has something else in a field than belongs there.
        """
        everybody = [acts.get(agent) for agent in self._stream]
        inputs = [self._input.silence if act is None else act.input for act in everybody]
        return Done(
            input=self._input.rows(inputs, self._whose["input"]),
            **{name: self._of_edges(name, everybody) for name in self._edges},
            reports={
                name: form.rows(
                    [unsaid if act is None else act.reports.get(name, unsaid) for act in everybody],
                    (f"{who}: {name}" for who in self._whose["reports"]),
                )
                for (name, form), unsaid in zip(self._reports.items(), self._unsaid, strict=True)
            },
        )

    def _of_edges(self, name: str, everybody: Sequence[messages.Act | None]) -> Any:
        shape, dtype, sizes = self._edges[name]
        said = [b"" if act is None else getattr(act, name) for act in everybody]
        given = [one or bytes(size) for one, size in zip(said, sizes, strict=True)]  # who has nothing to say has zeros
        rows = joined(given, sizes, (-1, *shape), dtype)
        if rows is None:
            each = zip(given, self._whose[name], self._degree, strict=True)
            rows = np.concatenate([_of_one(one, whose, degree, shape, dtype) for one, whose, degree in each])
        padded = np.zeros((*self._present.shape, *shape), dtype)
        padded[self._present] = rows
        return padded


def _of_one(given: Any, whose: str, degree: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
    rows = numbers(given, whose, (-1, *shape), dtype)
    if len(rows) != degree:
        raise WireError(
            f"{whose}: expected one for each of its {degree} neighbours, or none, got {len(rows)} (see docs/protocol.md)"
        )
    return rows
