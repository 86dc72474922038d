"""Changing the air of a run while it flies: who may, and how to ask."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pydantic import TypeAdapter

from affinet.planning.blueprint import formation_of
from affinet.scenario import selectors
from affinet.scenario.bounds import LARGEST
from affinet.scenario.sections import Scenario
from netem.core.links import Links
from netem.core.refusal import Refusal
from netem.faults.control import Answer, Order, OrderAction
from netem.faults.fault import Fault, UnderWay, Verb
from netem.processes.system_errors import about, afterwards
from netem.wire import messages
from netem.wire.carrier import NotCarried, joined
from netem.wire.keys import Keys
from netem.wire.session import Login

_FILE = "control.json"
_PATIENCE_S = 5.0
_CONNECT_S = 10.0


@dataclass(frozen=True)
class InjectRequest:
    """What a user wants to happen to the air, in the user's words.

    Parameters
    ----------
    verb
        "cut", "partition", "lose", "heal" or "show".
    links
        Selectors of links.
    groups
        Of agents, for a partition.
    loss
        Probability, for "lose".
    lasts_s
        Simulated seconds; None lasts to the end of the run, or until it is healed.
    in_flight
        What a cut or partition does to messages under way.
    """

    verb: str
    links: tuple[str, ...] = ()
    groups: tuple[tuple[int, ...], ...] = ()
    loss: float = 0.0
    lasts_s: float | None = None
    in_flight: str = UnderWay.DROP

    def order(self, flown: Scenario) -> Order:
        """The order that a run of this scenario understands.

        Raises
        ------
        ValueError
            When it selects nothing, or lasts no time, or its loss is no probability.
        """
        if self.verb in (OrderAction.HEAL, OrderAction.SHOW):
            return Order(OrderAction(self.verb), None)
        formation = formation_of(flown)
        chosen = selectors.pairs(self.links, formation, Links.both_ways(formation.agents, formation.edges))
        self._refuse_numbers()
        lasts = None if self.lasts_s is None else max(1, round(self.lasts_s / flown.time.dt))
        fault = Fault(
            Verb(self.verb),
            start=0,
            end=lasts,
            pairs=chosen,
            groups=self.groups,
            under_way=UnderWay(self.in_flight),
            probability=self.loss,
        )
        return Order(OrderAction.INJECT, fault)

    def _refuse_numbers(self) -> None:
        if self.lasts_s is not None and not 0.0 < self.lasts_s <= LARGEST:
            raise ValueError(
                f"--for {self.lasts_s:g}: give seconds above 0, at most {LARGEST:g}, or leave it out: until healed"
            )
        if not 0.0 <= self.loss <= 1.0:
            raise ValueError(f"a loss of {self.loss:g}: a probability lies in [0, 1]")


class NotFlying(Refusal, RuntimeError):
    """There is no such run, or it flies no more."""


@dataclass(frozen=True)
class Access:
    """The right to change a run: its name, and the login that may."""

    run: str
    login: Login

    @contextmanager
    def granted(self, out: Path, private: Path) -> Iterator[None]:
        """Leave the access in the run directory, for this user alone, for as long as the run flies.

        What stands there is a link into the private folder of the run, which goes however the run ends.
        """
        link, file = out / _FILE, private / _FILE
        with afterwards(partial(link.unlink, missing_ok=True), partial(file.unlink, missing_ok=True)):
            with about(link):
                file.touch(mode=0o600)
                file.write_text(json.dumps({"run": self.run, "login": vars(self.login)}))
                link.symlink_to(file)
            yield

    @classmethod
    def to(cls, out: Path) -> Access:
        """The access to the run that flies in this directory.

        Raises
        ------
        NotFlying
            When none does.
        """
        try:
            return TypeAdapter(cls).validate_json((out / _FILE).read_bytes(), strict=True)
        except FileNotFoundError as error:
            raise NotFlying(
                f"no run flies over processes in {out}; name the directory that `affinet run` printed"
            ) from error
        except ValueError as error:
            raise NotFlying(f"{out}: the run begins just now, or was broken off: {_FILE} is not whole") from error

    def ask(self, order: Order) -> Answer:
        """Give the medium an order; its answer.

        Raises
        ------
        NotFlying
            When nobody answers, or the medium could not read the order.
        """
        try:
            with joined(self.login, _CONNECT_S) as session:
                reply = session.ask(Keys(self.run).control, messages.pack(order), _PATIENCE_S)
        except NotCarried as error:
            raise NotFlying(f"the run has ended, stands still, or refuses: {error}") from error
        return messages.unpack(Answer, reply)
