"""Link profiles as they stand in a scenario: typed models of every impairment, with the presets that come with affinet."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import (
    ConfigDict,
    Field,
    PlainValidator,
    SerializeAsAny,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from affinet.scenario.keys import key
from affinet.scenario.reaches import Disk, LogDistance, Ramp
from affinet.scenario.section import Section
from affinet.scenario.trace_files import Traced, TraceFile
from affinet.scenario.units import (
    AtLeast1,
    Below1,
    BitsPerSecond,
    Finite,
    NotNegative,
    Probability,
    Steps,
    Ticks,
)
from affinet.scenario.words import among, hint, shown
from netem.impairments import netem_string
from netem.loading.offers import offered

IMPAIRMENTS = "affinet.impairments"  # the group of entry points

Step = Literal["time", "packet"]

_ENDLESS = 1e300  # s: beyond, a whole number is no float


class Bernoulli(Section):
    """Independent loss with probability p."""

    model: Literal["bernoulli"]
    p: Probability = key(..., "probability that a message is lost")


class Gilbert(Section):
    """Bursts of losses, by what they look like: mean loss, and mean burst in steps."""

    model: Literal["gilbert"]
    loss: Probability = key(..., "mean loss")
    burst: AtLeast1 = key(..., "mean length of a burst, in steps")
    extra_delay: NotNegative = key(0.0, "how much longer messages take in a burst", "s")
    step: Step = key("time", "the chain steps once a tick (time), or with each message offered (packet)")

    @model_validator(mode="after")
    def _possible(self) -> Gilbert:
        most = self.burst / (self.burst + 1.0)
        if self.loss > most:
            raise ValueError(
                f"bursts of mean length {self.burst:g} lose at most {most:.4g}; lengthen burst or lower loss"
            )
        return self


class GilbertElliott(Section):
    """Good and bad periods: p and r are the chances to go from good to bad and back, `good` and `bad` the losses in them."""

    model: Literal["gilbert-elliott"]
    p: Probability = key(..., "chance to go from good to bad, in a step")
    r: Probability = key(..., "chance to go back")
    bad: Probability = key(1.0, "loss in a bad period")
    good: Probability = key(0.0, "loss in a good one")
    extra_delay: NotNegative = key(0.0, "how much longer messages take in a bad period", "s")
    step: Step = key("time", "the chain steps once a tick (time), or with each message offered (packet)")


class Markov(Section):
    """The four-state model of netem's `loss state`."""

    model: Literal["markov"]
    p13: Probability = key(..., "chance from state 1 (received in a gap) to 3 (lost in a burst)")
    p31: Probability = key(..., "from 3 to 1")
    p32: Probability = key(..., "from 3 to 2 (received in a burst)")
    p23: Probability = key(..., "from 2 to 3")
    p14: Probability = key(..., "from 1 to 4 (lost by itself)")
    step: Step = key("time", "the chain steps once a tick (time), or with each message offered (packet)")


class Bursts(Section):
    """Mean loss, in bursts whose lengths 1, 2, ... have these probabilities."""

    model: Literal["bursts"]
    loss: Probability = key(..., "mean loss")
    lengths: Annotated[list[NotNegative], Field(min_length=1)] = key(..., "probabilities of bursts of 1, 2, ...")


class Listed(Section):
    """Exactly these messages of every link and channel, counted from 0."""

    model: Literal["list"]
    messages: Annotated[list[Ticks], Field(min_length=1)] = key(..., "their numbers")


class RoundRobin(Section):
    """Every agent attends to one neighbour at a time, for `hold` ticks."""

    model: Literal["round-robin"]
    hold: Steps = key(1, "ticks for each neighbour")


class Slotted(Section):
    """Every agent speaks in its own slot of `hold` ticks, one after the other."""

    model: Literal["slotted"]
    hold: Steps = key(1, "ticks of a slot")


class DutyCycle(Section):
    """Open for `on` ticks of every `period`."""

    model: Literal["duty-cycle"]
    period: Steps = key(..., "ticks from one opening to the next")
    on: Steps = key(..., "ticks for which it is open")

    @model_validator(mode="after")
    def _shorter(self) -> DutyCycle:
        if self.on > self.period:
            raise ValueError(f"on ({self.on} ticks) is longer than the period ({self.period} ticks)")
        return self


Loss = Annotated[
    Bernoulli
    | Gilbert
    | GilbertElliott
    | Markov
    | Bursts
    | Listed
    | Traced
    | Disk
    | Ramp
    | LogDistance
    | RoundRobin
    | Slotted
    | DutyCycle,
    Field(discriminator="model"),
]

LOSSES: dict[str, type[Section]] = {
    get_args(model.model_fields["model"].annotation)[0]: model for model in get_args(get_args(Loss)[0])
}


class Own(Section):
    """A loss that a package offers under this name, or of the user's own as "module:Class"; its parameters stand beside."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    model: str = key(..., '"module:Class", or a name that a package offers')

    @property
    def parameters(self) -> dict[str, Any]:
        """What is given beside the model."""
        return dict(self.model_extra or {})


def _own_or(given: Any, built_in: ValidatorFunctionWrapHandler) -> Any:
    model = given.get("model") if isinstance(given, dict) else None
    if isinstance(given, Own) or not isinstance(model, str) or model in LOSSES:
        return given if isinstance(given, Own) else built_in(given)
    known = [*LOSSES, *sorted(offered(IMPAIRMENTS))]
    if ":" not in model and model not in known:
        near = f"; {hint(model, known)}".rstrip("; ")
        raise ValueError(f"needs a model among {', '.join(known)}, or 'module:Class', got {shown(model)}{near}")
    return Own.model_validate(given)


AnyLoss = Annotated[Loss, WrapValidator(_own_or, json_schema_input_type=Loss | Own), SerializeAsAny()]


def _delays(given: Any) -> list[float] | str | None:
    if given is None or isinstance(given, str):
        return given
    if isinstance(given, list) and given and all(type(one) in (int, float) and 0 <= one < _ENDLESS for one in given):
        return list(map(float, given))
    raise ValueError("give delays in seconds, at least 0, like [0.010, 0.012], or the name of a file with one a line")


class DelayModel(Section):
    """One-way delay in seconds; `jitter` is a half-width (uniform) or a standard deviation (normal, pareto).

    `table` holds measured delays, or names a file of them; `trace` is a file that says which held when.
    """

    model: Literal["constant", "uniform", "normal", "exponential", "pareto", "table", "trace"] = key(
        ..., "how delays are distributed"
    )
    mean: NotNegative | None = key(None, "of a delay, one way", "s")
    jitter: NotNegative | None = key(None, "half-width (uniform), or standard deviation (normal, pareto)", "s")
    table: Annotated[
        list[float] | str | None, PlainValidator(_delays, json_schema_input_type=list[NotNegative] | str | None)
    ] = key(None, "measured delays, each as probable as the others, or a file of them", "s")
    trace: TraceFile | None = key(None, "a file of link data that says delays over time")
    correlation: Below1 = key(0.0, "from tick to tick")
    order: Literal["free", "kept"] = key("free", "whether messages may overtake each other")

    @model_validator(mode="after")
    def _whole(self) -> DelayModel:
        needs = {"table": {"table"}, "trace": {"trace"}, "constant": {"mean"}, "exponential": {"mean"}}.get(
            self.model, {"mean", "jitter"}
        )
        given = {name for name in ("mean", "jitter", "table", "trace") if getattr(self, name) is not None}
        if given != needs:
            raise ValueError(f"the model {self.model!r} is given by {' and '.join(sorted(needs))}")
        if self.model == "pareto" and not (self.mean and self.jitter):
            raise ValueError("a Pareto delay needs a mean and a jitter above 0")
        return self


class Corruption(Section):
    """Messages that arrive wrong, with probability p; `by` is what a bias adds to every number."""

    kind: Literal["stale", "bias", "nan", "bit-flip"] = key(
        ..., "how: what was said the tick before, a bias, NaN, or one bit of one number"
    )
    p: Probability = key(..., "probability")
    by: Finite | None = key(None, "of a bias: what is added to every number")

    @model_validator(mode="after")
    def _whole(self) -> Corruption:
        if (self.kind == "bias") != (self.by is not None):
            raise ValueError("give `by` with the kind 'bias', and with no other")
        return self


class RateLimit(Section):
    """A token bucket: rate in bits per second, or a file that says it over time; burst and queue in bytes."""

    rate: BitsPerSecond | None = key(None, "per directed link", "bit/s")
    trace: TraceFile | None = key(None, "a file of link data that says rates over time, in place of one rate")
    queue: Steps = key(10_000, "what may wait", "B")
    burst: Ticks = key(0, "what may pass at once", "B")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.rate is None) == (self.trace is None):
            raise ValueError("give a rate, or a trace of it")
        return self


class LinkProfile(Section):
    """What happens to the messages of a link. `like` names a profile to start from, `netem` is an option string of tc netem."""

    like: str | None = key(None, "a profile to start from, by name")
    # A scenario as resolved has what it means instead.
    netem: Annotated[str | None, Field(exclude=True)] = key(
        None, "an option string of tc netem, in place of what it means"
    )
    loss: list[AnyLoss] | None = key(None, "losses, each for itself: a message passes when none holds it")
    delay: DelayModel | None = key(None, "of communication; sensing is not delayed")
    duplicate: Probability | None = key(None, "probability that a message arrives twice")
    reorder: Probability | None = key(None, "probability that a message does not wait its delay, and overtakes")
    corrupt: list[Corruption] | None = key(None, "how messages arrive wrong")
    rate: RateLimit | None = key(None, "how much passes in a time")

    @model_validator(mode="before")
    @classmethod
    def _read_netem(cls, given: Any) -> Any:
        if not isinstance(given, dict) or not isinstance(given.get("netem"), str):
            return given
        read = netem_string.read(given["netem"]).profile
        if twice := sorted(read.keys() & given.keys()):
            raise ValueError(f"{', '.join(twice)}: given by netem and beside it")
        return given | read

    @model_validator(mode="after")
    def _whole(self) -> LinkProfile:
        kinds = [corruption.kind for corruption in self.corrupt or []]
        if len(set(kinds)) < len(kinds) or sum(corruption.p for corruption in self.corrupt or []) > 1.0:
            raise ValueError("corrupt: name each kind once; their probabilities add up to at most 1")
        for what in (("trace",), ("disk", "ramp", "log-distance"), ("round-robin", "slotted", "duty-cycle"), ("list",)):
            if sum(loss.model in what for loss in self.loss or []) > 1:
                raise ValueError(f"loss: at most one of {', '.join(what)}")
        return self

    @property
    def notes(self) -> tuple[str, ...]:
        """Where netem's own semantics mislead."""
        return netem_string.read(self.netem).notes if self.netem else ()

    @property
    def own(self) -> list[tuple[int, Own]]:
        """The losses that are none of ours, each with its number in the list, from 1."""
        losses: list[Any] = self.loss or []
        return [(number, loss) for number, loss in enumerate(losses, start=1) if isinstance(loss, Own)]

    def over(self, base: LinkProfile) -> LinkProfile:
        """This profile, with what it does not say taken from another."""
        said = {name: getattr(self, name) for name in type(self).model_fields if getattr(self, name) is not None}
        return base.model_copy(update={"netem": None} | said)


@cache
def presets() -> dict[str, LinkProfile]:
    """The profiles that come with affinet."""
    raw = tomllib.loads((resources.files("affinet.shipped") / "profiles.toml").read_text(encoding="utf-8"))
    return {name: LinkProfile.model_validate(profile) for name, profile in raw.items()}


def resolve(name: str, own: dict[str, LinkProfile]) -> LinkProfile:
    """The profile of a name, with all it is like.

    Raises
    ------
    ValueError
        When there is none, or profiles are like each other in a circle.
    """
    chain: list[str] = []
    found = LinkProfile()
    while True:
        if name in chain:
            raise ValueError(f"profiles are like each other in a circle: {' -> '.join([*chain, name])}")
        chain.append(name)
        here = own.get(name) or presets().get(name)
        if here is None:
            raise ValueError(f"no profile {name!r}; {among(name, sorted({*own, *presets()}))}")
        found = found.over(here)
        if here.like is None:
            return found
        name = here.like
