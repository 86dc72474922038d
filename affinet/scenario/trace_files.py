"""Files of link data as they stand in a scenario, with what cannot be known from them."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import PlainValidator, model_validator

from affinet.scenario.keys import key
from affinet.scenario.reaches import Disk, LogDistance, Ramp
from affinet.scenario.section import Section
from affinet.scenario.units import Finite, Moment, Positive, Probability, Steps, Ticks

# As affinet.traces.formats has them, whose readers take a while to import.
FormatName = Literal[
    "table", "ping", "iperf3", "mahimahi", "one", "contacts", "intervals", "emane", "setdest", "bonnmotion"
]

_ENDLESS = 1e300  # beyond, a whole number is no float


def _curve(given: Any) -> list[list[float]]:
    wants = "give a curve like [[-90, 0.0], [-70, 1.0]]: what was measured, which increases, and the availability at it"
    if not isinstance(given, list) or len(given) < 2:
        raise ValueError(wants)
    for point in given:
        pair = isinstance(point, list) and len(point) == 2 and all(type(one) in (int, float) for one in point)
        if not (pair and abs(point[0]) < _ENDLESS and 0.0 <= point[1] <= 1.0):
            raise ValueError(wants)
    if any(later[0] <= earlier[0] for earlier, later in pairwise(given)):
        raise ValueError(wants)
    return [[float(at), float(share)] for at, share in given]


Points = Annotated[list[list[float]], PlainValidator(_curve, json_schema_input_type=list[tuple[Finite, Probability]])]


class TraceFile(Section):
    """A file of link data, and what cannot be known from it."""

    file: str = key(..., "its name; or the directory of an earlier run")
    format: FormatName | None = key(None, "of the file, where its content does not tell")
    agents: dict[str, Steps] | None = key(
        None, "which agent a node of the file is, by its name there; others are left out"
    )
    first: Ticks = key(1, "number of the node that is agent 1, where nodes are numbered")
    begins: Moment = key(0.0, "time of the file at which the run begins", "s")
    interval: Positive | None = key(None, "of a ping without times: from one message to the next", "s")
    curve: Points | Disk | Ramp | LogDistance | None = key(
        None, "how much passes at a distance, signal or pathloss: points, or a loss by distance"
    )

    @model_validator(mode="after")
    def _once(self) -> Self:
        if self.agents is not None and self.first != 1:
            raise ValueError("give agents, or first, not both")
        if self.agents is not None and len(set(self.agents.values())) < len(self.agents):
            raise ValueError("agents: two nodes are one agent")
        if isinstance(self.curve, LogDistance) and self.curve.coherence:
            raise ValueError("curve: coherence is of a run's own distances; a curve has the mean over the shadowing")
        return self


class Traced(TraceFile):
    """Availability over time: from a file of link data (`affinet trace` shows it), or from the journal of an earlier run."""

    model: Literal["trace"]
