"""What agents do, read from the wire: every act is checked against the swarm it is in, and a wrong one names its agent."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Array, Mask
from netem.core.links import Links
from netem.core.plain import shown
from netem.wire import messages, values
from netem.wire.arrays import Form, joined, numbers, packed
from netem.wire.keys import Keys
from netem.wire.sequence import Sequences
from netem.wire.wrong import WireError, Wrong


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
    foreign, limit
        Agents whose numbers are looked at too, because nobody knows the program that computes them; and the longest input.
    in_real_time
        Whether what was decided in an earlier tick may come; what is awaited, and what was handed out by now, does not matter
        then.
    lost
        Told on which key, and how many acts are missing, if that is no reason to refuse the next one.
    """

    def __init__(
        self,
        keys: Keys,
        links: Links,
        dimension: int,
        reports: Mapping[str, tuple[int, ...]],
        foreign: frozenset[int] = frozenset(),
        limit: float | None = None,
        *,
        in_real_time: bool = False,
        lost: Callable[[str, int], None] | None = None,
    ) -> None:
        self._in_real_time = in_real_time
        self._speaking = {keys.act(agent): agent for agent in range(1, links.agents + 1)}
        self._present = links.present
        self._dimension, self._foreign, self._limit = dimension, foreign, limit
        self._input = Form((dimension,), truths=False)
        edge = {"estimate": (dimension,), "known": (), "covariance": (dimension * (dimension + 1) // 2,)}
        self._beliefs = [
            {name: Form((degree, *shape), truths=name == "known") for name, shape in edge.items()}
            for degree in links.present.sum(axis=1).tolist()
        ]
        self._reports = {name: Form(shape, truths=False) for name, shape in reports.items()}
        self._unsaid = [packed(np.full(shape, np.nan)) for shape in reports.values()]
        of_act = {f"{agent} act": key for key, agent in self._speaking.items()}
        self._streams = Sequences("agent", lost=lost and (lambda stream, number: lost(of_act[stream], number)))
        self._stream = {agent: f"{agent} act" for agent in self._speaking.values()}
        fields = ("input", "reports", *edge)
        self._whose = {name: [f"agent {agent}: Act: {name}" for agent in self._stream] for name in fields}
        self._heard = dict.fromkeys(self._stream, 0)
        self._handed: Sequence[int] = [0] * links.agents

    def speaker(self, key: str) -> int:
        """Whose key it is."""
        return self._speaking[key]

    def refuse(self, key: str) -> None:
        """Take note that an act was refused before its number was looked at."""
        self._streams.refuse(self._stream[self._speaking[key]])

    def restart(self, agent: int) -> None:
        """Expect the acts of a new process."""
        self._streams.restart(self._stream[agent])
        self._heard[agent] = 0

    def expect(self, handed: Sequence[int]) -> None:
        """In this tick so many broadcasts were put into each agent's inbox, by what the medium says."""
        self._handed = handed

    def unheard(self, act: messages.Act) -> int:
        """Of the broadcasts that it was handed in this tick, how many an agent says it has not heard; once for each act."""
        before, self._heard[act.src] = self._heard[act.src], act.heard
        return self._handed[act.src - 1] - (act.heard - before)

    def read(self, key: str, data: bytes, tick: int, awaited: Container[int]) -> messages.Act:
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
            When it is none, or not one of this tick, or not of an agent whose act is `awaited`; or something else stands in a
            field than belongs there.
        UninstructedLoss
            When one before it is missing.
        """
        agent = self._speaking[key]
        try:
            act = messages.unpack(messages.Act, data)
        except WireError as error:
            raise WireError(f"agent {agent}: {error}", error.wrong) from error
        if act.src != agent or not (0 <= act.k <= tick if self._in_real_time else act.k == tick):
            wrong = Wrong.SPOOFED if act.src != agent else Wrong.PAST if act.k < tick else Wrong.FUTURE
            raise WireError(f"agent {agent} in tick {tick}: agent {act.src} acts in tick {act.k}", wrong)
        if not (self._in_real_time or agent in awaited):
            says = f"agent {agent} in tick {tick}: it acts twice, or while it is dead or paused"
            raise WireError(says, Wrong.REPEATED)
        self._check_fields(agent, act)
        if not self._in_real_time:
            self._check_heard(agent, act)
        self._streams.check(self._stream[agent], act.seq)
        return act

    def _check_fields(self, agent: int, act: messages.Act) -> None:
        looking, row = agent in self._foreign, agent - 1
        if looking or not self._input.holds(act.input):
            given = numbers(act.input, self._whose["input"][row], self._input.shape)
            if looking:
                values.within(given, self._limit, self._whose["input"][row])
        for name, form in self._beliefs[row].items():
            said = getattr(act, name) or form.silence
            if looking or not form.holds(said):
                rows = _of_one(said, self._whose[name][row], form)
                if looking:
                    values.finite(rows, self._whose[name][row])
                if looking and name == "covariance":
                    values.variances(rows, self._dimension, self._whose[name][row])
        self._check_reports(act, self._whose["reports"][row], looking=looking)
        if looking:
            values.indicator(act.psi, f"agent {agent}: Act: psi")
        if act.punctuality is not None and not isfinite(act.punctuality.late):
            raise WireError(f"agent {agent}: Act: punctuality: late is {act.punctuality.late}", Wrong.VALUE)

    def _check_reports(self, act: messages.Act, whose: str, *, looking: bool) -> None:
        for name, said in act.reports.items():
            if (form := self._reports.get(name)) is None:
                known = ", ".join(self._reports) or "nothing"
                raise WireError(
                    f"{whose}: {shown(name)}: this run's estimator reports {known} (see docs/protocol.md)", Wrong.SHAPE
                )
            if looking or not form.holds(said):
                array = numbers(said, f"{whose}: {name}", form.shape)
                if looking:
                    values.finite(array, f"{whose}: {name}", undefined=True)

    def _check_heard(self, agent: int, act: messages.Act) -> None:
        """What it says that it heard must be what the medium says it delivered, message by message."""
        handed, heard = self._handed[agent - 1], act.heard - self._heard[agent]
        if not 0 <= heard <= handed:
            says = f"it was handed {handed} broadcasts in tick {act.k}, and has heard {heard} more than before"
            raise WireError(f"agent {agent}: Act: heard: {says} (see docs/protocol.md)", Wrong.MISCOUNTED)

    def together(self, acts: Mapping[int, messages.Act]) -> Done:
        """What the acts of a tick say, by number of the agent, as arrays of all."""
        everybody = [acts.get(agent) for agent in self._stream]
        inputs = [self._input.silence if act is None else act.input for act in everybody]
        return Done(
            input=self._input.rows(inputs, self._whose["input"]),
            **{name: self._of_edges(name, everybody) for name in self._beliefs[0]},
            reports={
                name: form.rows(
                    [unsaid if act is None else act.reports.get(name, unsaid) for act in everybody],
                    (f"{who}: {name}" for who in self._whose["reports"]),
                )
                for (name, form), unsaid in zip(self._reports.items(), self._unsaid, strict=True)
            },
        )

    def _of_edges(self, name: str, everybody: Sequence[messages.Act | None]) -> Any:
        forms = [beliefs[name] for beliefs in self._beliefs]
        said = [b"" if act is None else getattr(act, name) for act in everybody]
        given = [one or form.silence for one, form in zip(said, forms, strict=True)]  # who has nothing to say has zeros
        shape, dtype = forms[0].shape[1:], forms[0].dtype
        rows = joined(given, [len(form.silence) for form in forms], (-1, *shape), dtype)
        if rows is None:
            each = zip(given, self._whose[name], forms, strict=True)
            rows = np.concatenate([_of_one(one, whose, form) for one, whose, form in each])
        padded = np.zeros((*self._present.shape, *shape), dtype)
        padded[self._present] = rows
        return padded


def _of_one(given: Any, whose: str, form: Form) -> Any:
    degree, *shape = form.shape
    rows = numbers(given, whose, (-1, *shape), form.dtype)
    if len(rows) != degree:
        raise WireError(
            f"{whose}: expected one for each of its {degree} neighbours, or none, got {len(rows)} (see docs/protocol.md)",
            Wrong.SHAPE,
        )
    return rows
