"""The entries of a scenario's timeline as typed models: one for each verb."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, Field, PlainValidator, model_validator

from affinet.scenario import selectors
from affinet.scenario.profiles import Section
from affinet.scenario.units import Finite, NotNegative, Positive, Probability, Rate, Steps

Links = Annotated[str, AfterValidator(selectors.check)]
Whom = Annotated[list[Annotated[int | str, PlainValidator(selectors.agent_or_word)]], Field(min_length=1)]
On = Annotated[list[Links], Field(min_length=1)]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]
InFlight = Literal["drop", "deliver", "hold"]


class When(Section):
    """What an entry waits for: the tracking error (m2) below or above a level, for some simulated seconds in a row."""

    tracking_error_below: Positive | None = None
    tracking_error_above: NotNegative | None = None
    lasting: NotNegative = 0.0

    @model_validator(mode="after")
    def _one(self) -> When:
        if (self.tracking_error_below is None) == (self.tracking_error_above is None):
            raise ValueError("give tracking_error_below, or tracking_error_above")
        return self


class Event(Section):
    """When something happens: `at` counts in simulated seconds from the start, from another entry, or from a condition."""

    name: str | None = None
    at: NotNegative | None = None
    after: str | None = None
    when: When | None = None
    every: Positive | None = None
    times: Steps | None = None

    @model_validator(mode="after")
    def _timed(self) -> Event:
        if self.after is not None and self.when is not None:
            raise ValueError("give after, or when, not both")
        if self.at is None and self.after is None and self.when is None:
            raise ValueError("says not when: give at (s), after (the name of another entry), or when (a condition)")
        if self.times is not None and self.every is None:
            raise ValueError("times says how often; give every (s) as well")
        return self

    @property
    def relative(self) -> bool:
        """Whether `at` counts from something else than the start of the run."""
        return self.after is not None or self.when is not None


class Lasting(Event):
    """What lasts: `until` a time, or for as long as it `lasts`; without either, to the end of the run."""

    until: Positive | None = None
    lasts: Positive | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Lasting:
        if self.until is not None and self.lasts is not None:
            raise ValueError("give until, or lasts, not both")
        if self.until is not None and (self.relative or self.every is not None):
            raise ValueError("until is a time of the run; with after, when or every say how long it lasts")
        if self.until is not None and self.at is not None and self.until <= self.at:
            raise ValueError(f"ends at {self.until:g} s, but begins at {self.at:g} s; until must be later")
        if self.every is not None and (self.lasts is None or self.lasts > self.every):
            raise ValueError("what comes back every so many seconds lasts no longer than that: give lasts")
        return self


class Cut(Lasting):
    """Links that carry nothing; `in_flight` says what becomes of the messages under way on them."""

    verb: Literal["cut"] = "cut"
    links: On
    in_flight: InFlight = "drop"


class Partition(Lasting):
    """Groups between which nothing passes: lists of agents, or how to split the swarm in two."""

    verb: Literal["partition"] = "partition"
    groups: Annotated[list[list[int]] | str, PlainValidator(selectors.groups_or_word)]
    in_flight: InFlight = "drop"


class Lose(Lasting):
    """Links that lose messages with a probability, on top of what else they lose."""

    verb: Literal["lose"] = "lose"
    links: On
    loss: Probability


class Delay(Lasting):
    """Links whose communication takes longer, in seconds; sensing is not delayed."""

    verb: Literal["delay"] = "delay"
    links: On
    delay: Positive


class Degrade(Lasting):
    """Links that have another profile in place of their own."""

    verb: Literal["degrade"] = "degrade"
    links: On
    profile: str


class Heal(Event):
    """The end of what is scripted on links: of the entries named, or of all."""

    verb: Literal["heal"] = "heal"
    names: Annotated[list[str], Field(min_length=1)] | None = None


class Kill(Event):
    """Agents whose processes are killed (SIGKILL); their bodies hold."""

    verb: Literal["kill"] = "kill"
    agents: Whom


class Restart(Event):
    """Killed agents, or all of them, that come back as new processes: cold, knowing nothing, or warm, with their last state."""

    verb: Literal["restart"] = "restart"
    agents: Whom | None = None
    state: Literal["cold", "warm"] = "cold"


class Pause(Lasting):
    """Agents whose processes are stopped (SIGSTOP); their bodies fly on. What is sent to them waits, or is dropped."""

    verb: Literal["pause"] = "pause"
    agents: Whom
    in_flight: Literal["hold", "drop"] = "hold"


class Resume(Event):
    """Paused agents, or all of them, that go on (SIGCONT)."""

    verb: Literal["resume"] = "resume"
    agents: Whom | None = None


class Clock(Lasting):
    """Agents whose clocks gain (or lose) `rate` seconds per second; at its end they are right again."""

    verb: Literal["clock"] = "clock"
    agents: Whom
    rate: Rate

    @model_validator(mode="after")
    def _drifts(self) -> Clock:
        if self.rate == 0.0:
            raise ValueError("rate 0 is a clock that is right")
        return self


class Depart(Lasting):
    """Agents that leave the formation on purpose; their bodies hold, drift on, or vanish."""

    verb: Literal["depart"] = "depart"
    agents: Whom
    body: Literal["hold", "drift", "vanish"] = "hold"


class Rejoin(Event):
    """Departed agents, or all of them, that take part again."""

    verb: Literal["rejoin"] = "rejoin"
    agents: Whom | None = None


class Replace(Event):
    """Departed agents, or all of them, whose places are taken: new processes, which know nothing, in the bodies left behind."""

    verb: Literal["replace"] = "replace"
    agents: Whom | None = None


class Gust(Lasting):
    """A push: agents whose bodies are carried along, in metres per second."""

    verb: Literal["gust"] = "gust"
    agents: Whom
    velocity: Vector

    @model_validator(mode="after")
    def _blows(self) -> Gust:
        return _something(self, self.velocity, "velocity")


class Bias(Lasting):
    """Sensors that are off by a vector, in metres: of what is measured over these links."""

    verb: Literal["bias"] = "bias"
    links: On
    by: Vector

    @model_validator(mode="after")
    def _biased(self) -> Bias:
        return _something(self, self.by, "by")


class Outlier(Lasting):
    """Sensors that are wildly wrong now and then: with probability `p`, by a normal error of `sigma` metres per axis."""

    verb: Literal["outlier"] = "outlier"
    links: On
    p: Probability
    sigma: Positive


class Dropout(Lasting):
    """Sensors that make no measurement, with probability `p` in each tick."""

    verb: Literal["dropout"] = "dropout"
    links: On
    p: Probability = 1.0


class Freeze(Lasting):
    """Sensors that repeat their last measurement."""

    verb: Literal["freeze"] = "freeze"
    links: On


class Lie(Lasting):
    """Byzantine agents: every map Theta they tell is multiplied by a matrix from the left."""

    verb: Literal["lie"] = "lie"
    agents: Whom
    matrix: list[list[Finite]]

    @model_validator(mode="after")
    def _false(self) -> Lie:
        size = len(self.matrix)
        if size not in (2, 3) or any(len(row) != size for row in self.matrix):
            raise ValueError("matrix must be 2 x 2, or 3 x 3")
        if self.matrix == [[float(i == j) for j in range(size)] for i in range(size)]:
            raise ValueError("matrix is the identity: that is the truth")
        return self


def _something(entry: Any, vector: list[float], key: str) -> Any:
    if not any(vector):
        raise ValueError(f"{key} is zero: that is nothing")
    return entry


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
