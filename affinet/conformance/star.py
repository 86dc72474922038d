"""The network of a flight against one agent: a router that lets one client in, and what the client publishes."""

from __future__ import annotations

import secrets
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, NamedTuple

from netem.wire import keys
from netem.wire.carrier import Arrived, Session
from netem.wire.keys import Keys
from netem.wire.rights import hub
from netem.wire.session import HUB, Login, agent_name, dictionary


class Published(NamedTuple):
    """Something that the agent published: on which channel, or `act`, and what."""

    stream: str
    data: bytes


class Star:
    """A router that lets one agent in.

    Parameters
    ----------
    folder
        Where its socket lies.
    agent
        Who may log in.
    happened
        Where what it publishes is put.
    """

    def __init__(self, folder: Path, agent: int, happened: SimpleQueue[Any]) -> None:
        self.run = keys.fresh()
        of_run, endpoint = Keys(self.run), f"unixsock-stream/{folder}/z.sock"
        ours, self.login = (Login(endpoint, name, secrets.token_hex(16)) for name in (HUB, agent_name(agent)))
        self._happened = happened
        with dictionary({login.name: login.password for login in (ours, self.login)}) as file:
            self._session = Session(hub(ours, file, of_run, [agent], {}))
        self._session.hands(of_run.broadcast(agent, "*"), self._note)
        self._session.hands(of_run.act(agent), self._note)
        self._inbox, self._told = self._session.says(of_run.inbox(agent)), self._session.says(of_run.told(agent))

    def __enter__(self) -> Star:
        self._session.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._session.__exit__(kind, error, trace)

    @property
    def is_heard(self) -> bool:
        """Whether the agent subscribes to its inbox."""
        return self._inbox.is_heard

    def hand(self, inbox: bytes) -> None:
        """Put something into its inbox."""
        self._inbox.say(inbox)

    def tell(self, told: bytes) -> None:
        """Say something as the centre would."""
        self._told.say(told)

    def _note(self, arrived: Arrived) -> None:
        self._happened.put(Published(arrived.key.rpartition("/")[2], arrived.data))
