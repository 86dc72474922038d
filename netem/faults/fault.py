"""A scripted fault: what happens to whom, and in which ticks."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from netem.core.listing import listed


class Verb(StrEnum):
    """What a fault does while it lasts."""

    CUT = "cut"
    PARTITION = "partition"
    LOSE = "lose"
    DELAY = "delay"
    DEGRADE = "degrade"
    KILL = "kill"
    PAUSE = "pause"
    CLOCK = "clock"
    DEPART = "depart"
    GUST = "gust"
    BIAS = "bias"
    OUTLIER = "outlier"
    DROPOUT = "dropout"
    FREEZE = "freeze"
    LIE = "lie"


# Verbs that strike with a probability, and those of what is measured rather than of all that is said.
BY_CHANCE = frozenset({Verb.LOSE, Verb.DROPOUT, Verb.OUTLIER})
OF_SENSORS = frozenset({Verb.FREEZE, Verb.BIAS, Verb.OUTLIER, Verb.DROPOUT})


class UnderWay(StrEnum):
    """What a fault does to the messages under way on its links."""

    DROP = "drop"
    DELIVER = "deliver"
    HOLD = "hold"


class DepartedBody(StrEnum):
    """What becomes of the body of an agent that departs."""

    HOLD = "hold"
    DRIFT = "drift"
    VANISH = "vanish"


Pairs = tuple[tuple[int, int], ...]

_ENDS = {Verb.KILL: "restart", Verb.PAUSE: "resume", Verb.DEPART: "rejoin"}


@dataclass(frozen=True)
class Fault:
    """One scripted fault, active in the ticks start <= k < end; only the fields of its verb are filled.

    Parameters
    ----------
    verb
        What happens. To directed links `pairs`: CUT, LOSE, DELAY, DEGRADE; to what is measured over them: BIAS, OUTLIER,
        DROPOUT, FREEZE. Between `groups`: PARTITION. To `agents`: KILL and PAUSE of their processes, CLOCK, DEPART, GUST, LIE.
    start, end
        Ticks; `end` is None for a fault that lasts to the end of the run.
    trigger
        Number of the trigger from whose tick `start` and `end` count, until it fires; None when they are ticks of the run.
    pairs, groups, agents
        What it takes hold of.
    under_way
        What CUT and PARTITION do to messages under way: drop them, deliver them when they are due, or hold them and deliver
        them when it ends, in order; and whether PAUSE drops or holds what is sent to the agent.
    body
        What becomes of the body under DEPART.
    warm
        Whether an agent under KILL comes back with its own last state, rather than knowing nothing.
    probability
        With which LOSE loses a message, OUTLIER and DROPOUT strike a measurement.
    seconds
        By which DELAY delays a message.
    rate
        By which a clock gains, in seconds per second.
    deviation
        Standard deviation of what OUTLIER adds, per axis, in metres.
    vector
        What BIAS adds to a measurement, in metres; how fast GUST pushes, in metres per second.
    matrix
        Of LIE: rows of the matrix by which every map that is told is multiplied from the left.
    profile, profile_name
        Number and name of the profile that DEGRADE puts in place of the links' own, from 1.
    """

    verb: Verb
    start: int
    end: int | None
    trigger: int | None = None
    pairs: Pairs = ()
    groups: tuple[tuple[int, ...], ...] = ()
    agents: tuple[int, ...] = ()
    under_way: UnderWay = UnderWay.DROP
    body: DepartedBody = DepartedBody.HOLD
    warm: bool = False
    probability: float = 0.0
    seconds: float = 0.0
    rate: float = 0.0
    deviation: float = 0.0
    vector: tuple[float, ...] = ()
    matrix: tuple[tuple[float, ...], ...] = ()
    profile: int = 0
    profile_name: str = ""

    def active(self, tick: int) -> bool:
        """Whether it holds in this tick."""
        return self.trigger is None and self.start <= tick and (self.end is None or tick < self.end)

    def describe(self) -> str:
        """What it does, for people."""
        who = ",".join(map(str, self.agents))
        match self.verb:
            case Verb.PARTITION:
                return "partition " + " | ".join(",".join(map(str, group)) for group in self.groups)
            case Verb.CUT | Verb.FREEZE:
                return f"{self.verb} {self.links()}"
            case Verb.LOSE | Verb.DROPOUT:
                return f"{self.verb} {self.probability:g} on {self.links()}"
            case Verb.OUTLIER:
                return f"outlier {self.probability:g} of {self.deviation:g} m on {self.links()}"
            case Verb.DELAY:
                return f"delay {self.seconds:g} s on {self.links()}"
            case Verb.DEGRADE:
                return f"degrade to {self.profile_name!r} on {self.links()}"
            case Verb.BIAS:
                return f"bias {_numbers(self.vector)} m on {self.links()}"
            case Verb.GUST:
                return f"gust {_numbers(self.vector)} m/s on {who}"
            case Verb.CLOCK:
                return f"clock {self.rate:+g} s/s of {who}"
            case Verb.KILL | Verb.PAUSE | Verb.LIE:
                return f"{self.verb} {who}"
            case Verb.DEPART:
                return f"depart {who}" + ("" if self.body is DepartedBody.HOLD else f", bodies {self.body}")

    def describe_end(self) -> str:
        """What its end does, for people."""
        if self.verb in _ENDS:
            return f"{_ENDS[self.verb]} {','.join(map(str, self.agents))}{' warm' if self.warm else ''}"
        return f"heal: {self.describe()}"

    def links(self) -> str:
        """The links that it names, for people."""
        return listed((f"{src}->{dst}" for src, dst in self.pairs), most=12)


def _numbers(vector: tuple[float, ...]) -> str:
    return f"({', '.join(f'{number:g}' for number in vector)})"
