"""Every key expression of a run, built in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Keys:
    """The keys of one run; `agent` is an agent's number, or "*" for all of them."""

    run: str

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
