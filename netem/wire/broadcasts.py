"""What agents broadcast, read from the wire: checked against the tick and the key it came in; a wrong one names its agent."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

from netem.core.plain import shown
from netem.wire import messages
from netem.wire.arrays import WireError
from netem.wire.keys import Keys
from netem.wire.sequence import Sequences


class Broadcasts:
    """Reads the broadcasts of a run.

    Parameters
    ----------
    keys
        Of the run.
    agents, channels
        Who broadcasts, and on which channels.
    """

    def __init__(self, keys: Keys, agents: Iterable[int], channels: Sequence[str]) -> None:
        self._speaking = {keys.broadcast(agent, name): (agent, name) for agent in agents for name in channels}
        self._channels = list(channels)
        self._streams = Sequences("agent")

    def restart(self, agent: int) -> None:
        """Expect the broadcasts of a new process."""
        for name in self._channels:
            self._streams.restart(f"{agent} {name}")

    def read(self, key: str, data: bytes, tick: int, awaited: Container[tuple[int, str]]) -> messages.Broadcast:
        """The broadcast that came on a key, which access control leaves to one agent.

        Parameters
        ----------
        key, data
            As it came.
        tick
            In which the medium is.
        awaited
            Agents and channels that are to come.

        Raises
        ------
        WireError
            When it is none, or not one of this tick, or none that is `awaited`.
        UninstructedLoss
            When one before it is missing.
        """
        said, whose = self._unpacked(key, data)
        if said.k != tick:
            raise WireError(f"{whose} in tick {tick}: it speaks of tick {said.k} (see docs/protocol.md)")
        self._streams.check(f"{said.src} {said.channel}", said.seq)
        if (said.src, said.channel) not in awaited:
            raise WireError(f"{whose}: it speaks twice in tick {tick}, or while it is dead or paused")
        return said

    def read_when_it_comes(self, key: str, data: bytes, tick: int) -> messages.Broadcast:
        """The broadcast that came on a key in this tick, of which or of an earlier one it speaks.

        Raises
        ------
        WireError
            When it is none, or speaks of what is yet to come, or does not say when it was said.
        UninstructedLoss
            When one before it is missing.
        """
        said, whose = self._unpacked(key, data)
        if not 0 <= said.k <= tick or said.at is None:
            raise WireError(f"{whose} in tick {tick}: it speaks of tick {said.k}, at {said.at} (see docs/protocol.md)")
        self._streams.check(f"{said.src} {said.channel}", said.seq)
        return said

    def _unpacked(self, key: str, data: bytes) -> tuple[messages.Broadcast, str]:
        _, agent, _, channel = key.rsplit("/", 3)
        whose = f"agent {agent} on {channel!r}"
        try:
            said = messages.unpack_relayed(data)
        except WireError as error:
            raise WireError(f"{whose}: {error}") from error
        if self._speaking.get(key) != (said.src, said.channel):
            raise WireError(
                f"{whose}: it speaks as agent {said.src}, on {shown(said.channel)}; "
                f"channels here are {', '.join(self._channels)} (see docs/protocol.md)"
            )
        return said, whose
