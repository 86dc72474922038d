"""The entries of a scenario's timeline as typed models: one for each verb, with the faults it stands for."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, PlainValidator, model_validator

from affinet.scenario import selectors
from affinet.scenario.events import Event, Found, InFlight, Lasting, On, Vector, Whom
from affinet.scenario.keys import key
from affinet.scenario.units import Finite, Positive, Probability, Rate
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb


class Cut(Lasting):
    """Links that carry nothing; `in_flight` says what becomes of the messages under way on them."""

    verb: Literal["cut"] = "cut"
    links: On = key(..., 'which, like "all" or ["1-2", "2->4"]')
    in_flight: InFlight = key("drop", "what becomes of the messages under way on them")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.CUT, 0, None, pairs=found.links(self.links), under_way=UnderWay(self.in_flight))]


class Partition(Lasting):
    """Groups between which nothing passes: lists of agents, or how to split the swarm in two."""

    verb: Literal["partition"] = "partition"
    groups: Annotated[
        list[list[int]] | str,
        PlainValidator(
            selectors.groups_or_word, json_schema_input_type=list[list[int]] | Literal["halves", "leaders", "min-cut"]
        ),
    ] = key(..., 'lists of agents, or "halves" (by number), "leaders" (and the others), "min-cut"')
    in_flight: InFlight = key("drop", "what becomes of the messages under way between them")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.PARTITION, 0, None, groups=found.groups(self.groups), under_way=UnderWay(self.in_flight))]


class Lose(Lasting):
    """Links that lose messages with a probability, on top of what else they lose."""

    verb: Literal["lose"] = "lose"
    links: On = key(..., 'which, like "all" or ["1-2", "2->4"]')
    loss: Probability = key(..., "probability that a message is lost")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.LOSE, 0, None, pairs=found.links(self.links), probability=self.loss)]


class Delay(Lasting):
    """Links whose communication takes longer, in seconds; sensing is not delayed."""

    verb: Literal["delay"] = "delay"
    links: On = key(..., 'which, like "all" or ["1-2", "2->4"]')
    delay: Positive = key(..., "by how much longer it takes", "s")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.DELAY, 0, None, pairs=found.links(self.links), seconds=self.delay)]


class Degrade(Lasting):
    """Links that have another profile in place of their own."""

    verb: Literal["degrade"] = "degrade"
    links: On = key(..., 'which, like "all" or ["1-2", "2->4"]')
    profile: str = key(..., "by name")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        number = found.profile(self.profile)
        return [Fault(Verb.DEGRADE, 0, None, pairs=found.links(self.links), profile=number, profile_name=self.profile)]


class Heal(Event):
    """The end of what is scripted on links: of the entries named, or of all."""

    verb: Literal["heal"] = "heal"
    names: Annotated[list[str], Field(min_length=1)] | None = key(None, "of the entries to end; without it all")


class Kill(Event):
    """Agents whose processes are killed (SIGKILL); their bodies hold."""

    verb: Literal["kill"] = "kill"
    agents: Whom = key(..., 'whose, like [4, "leaders"]')

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.KILL, 0, None, agents=(agent,)) for agent in found.agents(self.agents)]


class Restart(Event):
    """Killed agents, or all of them, that come back as new processes: cold, knowing nothing, or warm, with their last state."""

    verb: Literal["restart"] = "restart"
    agents: Whom | None = key(None, "which, of those killed; without it all")
    state: Literal["cold", "warm"] = key("cold", "cold: knowing nothing; warm: with the last state of its own")


class Pause(Lasting):
    """Agents whose processes are stopped (SIGSTOP); their bodies fly on. What is sent to them waits, or is dropped."""

    verb: Literal["pause"] = "pause"
    agents: Whom = key(..., 'whose, like [4, "leaders"]')
    in_flight: Literal["hold", "drop"] = key("hold", "what is sent to them waits (hold), or is lost (drop)")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        policy = UnderWay(self.in_flight)
        return [Fault(Verb.PAUSE, 0, None, agents=(one,), under_way=policy) for one in found.agents(self.agents)]


class Resume(Event):
    """Paused agents, or all of them, that go on (SIGCONT)."""

    verb: Literal["resume"] = "resume"
    agents: Whom | None = key(None, "which, of those paused; without it all")


class Clock(Lasting):
    """Agents whose clocks gain (or lose) `rate` seconds per second; at its end they are right again."""

    verb: Literal["clock"] = "clock"
    agents: Whom = key(..., 'whose, like [4, "leaders"]')
    rate: Rate = key(..., "seconds that they gain per second")

    @model_validator(mode="after")
    def _drifts(self) -> Clock:
        if self.rate == 0.0:
            raise ValueError("rate 0 is a clock that is right")
        return self

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.CLOCK, 0, None, agents=found.agents(self.agents), rate=self.rate)]


class Depart(Lasting):
    """Agents that leave the formation on purpose; their bodies hold, drift on, or vanish."""

    verb: Literal["depart"] = "depart"
    agents: Whom = key(..., 'which, like [4, "leaders"]')
    body: Literal["hold", "drift", "vanish"] = key("hold", "what becomes of their bodies")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        body = DepartedBody(self.body)
        return [Fault(Verb.DEPART, 0, None, agents=(agent,), body=body) for agent in found.agents(self.agents)]


class Rejoin(Event):
    """Departed agents, or all of them, that take part again."""

    verb: Literal["rejoin"] = "rejoin"
    agents: Whom | None = key(None, "which, of those departed; without it all")


class Replace(Event):
    """Departed agents, or all of them, whose places are taken: new processes, which know nothing, in the bodies left behind."""

    verb: Literal["replace"] = "replace"
    agents: Whom | None = key(None, "which, of those departed; without it all")


class Gust(Lasting):
    """A push: agents whose bodies are carried along, in metres per second."""

    verb: Literal["gust"] = "gust"
    agents: Whom = key(..., 'which, like [4, "leaders"]')
    velocity: Vector = key(..., "with which they are carried along", "m/s")

    @model_validator(mode="after")
    def _blows(self) -> Gust:
        return _something(self, self.velocity, "velocity")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.GUST, 0, None, agents=found.agents(self.agents), vector=found.numbers("velocity"))]


class Bias(Lasting):
    """Sensors that are off by a vector, in metres: of what is measured over these links."""

    verb: Literal["bias"] = "bias"
    links: On = key(..., "what the last agent of each measures of the first")
    by: Vector = key(..., "what is added to every measurement", "m")

    @model_validator(mode="after")
    def _biased(self) -> Bias:
        return _something(self, self.by, "by")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        _refuse_metres(self.verb, found)
        return [Fault(Verb.BIAS, 0, None, pairs=found.links(self.links), vector=found.numbers("by"))]


class Outlier(Lasting):
    """Sensors that are wildly wrong now and then: with probability `p`, by a normal error of `sigma` metres per axis."""

    verb: Literal["outlier"] = "outlier"
    links: On = key(..., "what the last agent of each measures of the first")
    p: Probability = key(..., "probability that a measurement is wrong")
    sigma: Positive = key(..., "standard deviation of the error, per axis", "m")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        _refuse_metres(self.verb, found)
        pairs = found.links(self.links)
        return [Fault(Verb.OUTLIER, 0, None, pairs=pairs, probability=self.p, deviation=self.sigma)]


class Dropout(Lasting):
    """Sensors that make no measurement, with probability `p` in each tick."""

    verb: Literal["dropout"] = "dropout"
    links: On = key(..., "what the last agent of each measures of the first")
    p: Probability = key(1.0, "probability that no measurement is made")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.DROPOUT, 0, None, pairs=found.links(self.links), probability=self.p)]


class Freeze(Lasting):
    """Sensors that repeat their last measurement."""

    verb: Literal["freeze"] = "freeze"
    links: On = key(..., "what the last agent of each measures of the first")

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.FREEZE, 0, None, pairs=found.links(self.links))]


class Lie(Lasting):
    """Byzantine agents: every map Theta they tell is multiplied by a matrix from the left."""

    verb: Literal["lie"] = "lie"
    agents: Whom = key(..., 'which, like [4, "leaders"]')
    matrix: list[list[Finite]] = key(..., "by which every Theta is multiplied, 2 x 2, or 3 x 3")

    @model_validator(mode="after")
    def _false(self) -> Lie:
        size = len(self.matrix)
        if size not in (2, 3) or any(len(row) != size for row in self.matrix):
            raise ValueError("matrix must be 2 x 2, or 3 x 3")
        if self.matrix == [[float(i == j) for j in range(size)] for i in range(size)]:
            raise ValueError("matrix is the identity: that is the truth")
        return self

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times."""
        return [Fault(Verb.LIE, 0, None, agents=found.agents(self.agents), matrix=found.numbers("matrix"))]


def _something(entry: Any, vector: list[float], key: str) -> Any:
    if not any(vector):
        raise ValueError(f"{key} is zero: that is nothing")
    return entry


def _refuse_metres(verb: str, found: Found) -> None:
    if not found.says_positions:
        raise ValueError(f"{verb} is in metres, and sensors here say directions; let them freeze, or drop out")


AnyEvent = Annotated[
    Cut
    | Partition
    | Lose
    | Delay
    | Degrade
    | Heal
    | Kill
    | Restart
    | Pause
    | Resume
    | Clock
    | Depart
    | Rejoin
    | Replace
    | Gust
    | Bias
    | Outlier
    | Dropout
    | Freeze
    | Lie,
    Field(discriminator="verb"),
]

VERBS: dict[str, type[Event]] = {model.model_fields["verb"].default: model for model in get_args(get_args(AnyEvent)[0])}
