"""Every key expression of a run, built in one place."""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass

_AGAIN = "/again"
_PLAIN = re.compile(r"[A-Za-z0-9_-]+")


def fresh() -> str:
    """A name for a run, unlike any other; it holds nothing that a user wrote, for a key expression is a grammar."""
    return secrets.token_hex(8)


def again(key: str) -> str:
    """Queryable: what was said on a key last (between machines)."""
    return f"{key}{_AGAIN}"


def once(key: str) -> str:
    """The key on which that was said which is asked for on this one."""
    return key.removesuffix(_AGAIN)


@dataclass(frozen=True)
class Keys:
    """The keys of one run; `agent` is an agent's number, or "*" for all of them."""

    run: str

    def __post_init__(self) -> None:
        if not _PLAIN.fullmatch(self.run):
            raise ValueError(f"a run called {self.run!r} has no keys: use letters, digits, '_' and '-'")

    def broadcast(self, agent: int | str, channel: str) -> str:
        """What an agent broadcasts on one channel (agent to medium)."""
        return f"affinet/{self.run}/agent/{agent}/tx/{channel}"

    def inbox(self, agent: int | str) -> str:
        """What the medium delivers to an agent (medium to agent)."""
        return f"affinet/{self.run}/agent/{agent}/rx"

    def act(self, agent: int | str) -> str:
        """An agent's control input, and what it reports about itself (agent to world)."""
        return f"affinet/{self.run}/agent/{agent}/act"

    def told(self, agent: int | str) -> str:
        """What a centralized filter tells an agent (centre to agent, past the medium)."""
        return f"affinet/{self.run}/agent/{agent}/told"

    def roster(self, host: int) -> str:
        """Who of a host's agents takes part in a tick (medium to host)."""
        return f"affinet/{self.run}/host/{host}/roster"

    def measured(self, agent: int | str) -> str:
        """What is measured on an agent's robot (driver to world), where robots fly outside."""
        return f"affinet/{self.run}/robot/{agent}/measured"

    def command(self, agent: int | str) -> str:
        """What an agent's robot is to fly (world to driver)."""
        return f"affinet/{self.run}/robot/{agent}/command"

    @property
    def sense(self) -> str:
        """The world's raw sensing of a tick (world to medium)."""
        return f"affinet/{self.run}/world/sense"

    @property
    def journal(self) -> str:
        """The verdicts of a tick (medium to world)."""
        return f"affinet/{self.run}/netem/journal"

    @property
    def control(self) -> str:
        """Queryable: read and change the faults of a run while it flies (anybody with the run's control login)."""
        return f"affinet/{self.run}/netem/control"
