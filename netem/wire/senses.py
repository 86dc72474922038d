"""What the world senses, read from the wire: of the tick that is due, and as much as there are links and agents."""

from __future__ import annotations

from netem.wire import messages
from netem.wire.arrays import FLOAT
from netem.wire.sequence import Sequences
from netem.wire.wrong import WireError, Wrong


class Senses:
    """Reads what the world says.

    Parameters
    ----------
    links, agents, dimension
        How many there are, and D.
    """

    def __init__(self, links: int, agents: int, dimension: int) -> None:
        self._place = dimension * FLOAT.itemsize
        self._measured, self._agents = links * self._place, agents
        self._stream = Sequences("world")

    def read(self, data: bytes, tick: int) -> messages.Sense:
        """What came, in the tick in which the medium is.

        Raises
        ------
        WireError
            When it is something else.
        UninstructedLoss
            When something before it is missing.
        """
        sense = messages.unpack(messages.Sense, data)
        self._stream.check("sense", sense.seq)
        if sense.k != tick:
            wrong = Wrong.PAST if sense.k < tick else Wrong.FUTURE
            raise WireError(f"the world senses tick {sense.k}, the medium is in tick {tick}", wrong)
        if not (sense.last or self._fits(sense)):
            of = f"{self._measured // self._place} links and {self._agents} agents"
            raise WireError(f"the world: Sense: its arrays are not those of {of} (see docs/protocol.md)", Wrong.SHAPE)
        return sense

    def _fits(self, sense: messages.Sense) -> bool:
        everybody = self._agents * self._place
        motion, sightings = sense.motion, sense.sightings
        return (
            len(sense.measured) == self._measured
            and len(sense.position) == everybody
            and (motion is None or len(motion) % everybody == 0)
            and (sense.flown is None or len(sense.flown) == everybody)
            and (sightings is None or [len(one.position) for one in sightings] == [self._place] * self._agents)
        )
