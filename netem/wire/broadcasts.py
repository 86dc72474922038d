"""What agents broadcast, read from the wire: checked against the tick and the key it came in; a wrong one names its agent."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from math import isfinite

from netem.core.plain import shown
from netem.wire import messages
from netem.wire.keys import Keys
from netem.wire.payloads import Payloads
from netem.wire.sequence import Sequences
from netem.wire.wrong import WireError, Wrong


class Broadcasts:
    """Reads the broadcasts of a run.

    Parameters
    ----------
    keys
        Of the run.
    agents, channels
        Who broadcasts, and on which channels.
    payloads
        What they may say there.
    in_real_time
        Whether they may speak of ticks that are over, and say when they do; what is awaited is nobody's matter then.
    lost
        Told on which key, and how many messages are missing, if that is no reason to refuse the next one.
    """

    def __init__(
        self,
        keys: Keys,
        agents: Iterable[int],
        channels: Sequence[str],
        payloads: Payloads,
        *,
        in_real_time: bool = False,
        lost: Callable[[str, int], None] | None = None,
    ) -> None:
        self._in_real_time = in_real_time
        self._speaking = {keys.broadcast(agent, name): (agent, name) for agent in agents for name in channels}
        self._channels, self._payloads = list(channels), payloads
        self._stream = {key: f"{agent} {name}" for key, (agent, name) in self._speaking.items()}
        of_voice = {stream: key for key, stream in self._stream.items()}
        self._streams = Sequences("agent", lost=lost and (lambda stream, number: lost(of_voice[stream], number)))

    def speaker(self, key: str) -> int:
        """Whose key it is."""
        speaking = self._speaking.get(key)
        return int(key.rsplit("/", 3)[1]) if speaking is None else speaking[0]

    def refuse(self, key: str) -> None:
        """Take note that a broadcast was refused before its number was looked at."""
        if (stream := self._stream.get(key)) is not None:
            self._streams.refuse(stream)

    def restart(self, agent: int) -> None:
        """Expect the broadcasts of a new process."""
        for name in self._channels:
            self._streams.restart(f"{agent} {name}")

    def read(self, key: str, data: bytes, tick: int, awaited: Container[tuple[int, str]]) -> messages.Broadcast:
        """The broadcast that came on a key, which access control leaves to one agent; of a wrong one no note is taken.

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
        try:
            said = messages.unpack_relayed(data)
        except WireError as error:
            raise WireError(f"{_whose(key)}: {error}", error.wrong) from error
        spoofed = self._speaking.get(key) != (said.src, said.channel)
        if spoofed or not (0 <= said.k <= tick if self._in_real_time else said.k == tick):
            raise WireError(
                f"{_whose(key)} in tick {tick}: it speaks as agent {said.src}, on {shown(said.channel)}, of tick {said.k}; "
                f"channels here are {', '.join(self._channels)} (see docs/protocol.md)",
                Wrong.SPOOFED if spoofed else Wrong.PAST if said.k < tick else Wrong.FUTURE,
            )
        if self._in_real_time:
            _refuse_timeless(said, _whose(key))
        elif (said.src, said.channel) not in awaited:
            says = f"{_whose(key)}: it speaks twice in tick {tick}, or while it is dead or paused"
            raise WireError(says, Wrong.REPEATED)
        self._payloads.check(said.src, said.channel, said.payload)
        self._streams.check(self._stream[key], said.seq)
        return said


def _refuse_timeless(said: messages.Broadcast, whose: str) -> None:
    if said.at is None or not isfinite(said.at):
        raise WireError(f"{whose}: at: in real time it says when, got {said.at} (see docs/protocol.md)", Wrong.VALUE)


def _whose(key: str) -> str:
    _, agent, _, channel = key.rsplit("/", 3)
    return f"agent {agent} on {channel!r}"
