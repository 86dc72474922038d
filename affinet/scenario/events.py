"""What all entries of a timeline have in common: when they happen, whom they name, and what they find there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, model_validator

from affinet.scenario import selectors
from affinet.scenario.keys import key
from affinet.scenario.section import Section
from affinet.scenario.units import Finite, NotNegative, Positive, Steps
from netem.faults.fault import Fault, Pairs

Links = Annotated[str, AfterValidator(selectors.check)]
Whom = Annotated[
    list[Annotated[int | str, PlainValidator(selectors.agent_or_word, json_schema_input_type=int | str)]],
    Field(min_length=1),
]
_SeveralLinks = Annotated[list[Links], Field(min_length=1)]
On = Annotated[_SeveralLinks, BeforeValidator(selectors.several, json_schema_input_type=Links | _SeveralLinks)]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]
InFlight = Literal["drop", "deliver", "hold"]


class Found(NamedTuple):
    """What an entry finds in the scenario; all of it fails with the key where something is not there.

    Parameters
    ----------
    links, agents, groups
        The links, agents and groups that selectors name.
    numbers
        A vector or the rows of a matrix, by their key, if they are of the formation's dimension.
    profile
        The number of a profile, by its name.
    says_positions
        Whether sensors say how far away things are.
    """

    links: Callable[[Sequence[str]], Pairs]
    agents: Callable[[Sequence[int | str]], tuple[int, ...]]
    groups: Callable[[list[list[int]] | str], tuple[tuple[int, ...], ...]]
    numbers: Callable[[str], tuple[Any, ...]]
    profile: Callable[[str], int]
    says_positions: bool


class When(Section):
    """What an entry waits for: the tracking error (m2) below or above a level, for some simulated seconds in a row."""

    tracking_error_below: Positive | None = key(None, "it waits until the tracking error is below this", "m2")
    tracking_error_above: NotNegative | None = key(None, "or above this", "m2")
    lasting: NotNegative = key(0.0, "for so long in a row", "s")

    @model_validator(mode="after")
    def _one(self) -> When:
        if (self.tracking_error_below is None) == (self.tracking_error_above is None):
            raise ValueError("give tracking_error_below, or tracking_error_above")
        return self


class Event(Section):
    """When something happens: `at` counts in simulated seconds from the start, from another entry, or from a condition."""

    name: str | None = key(None, "by which other entries refer to this one")
    at: NotNegative | None = key(None, "when, counted from the start, or from what `after` or `when` say", "s")
    after: str | None = key(
        None, 'another entry by its name, from whose beginning `at` counts; "name.end" from its end'
    )
    when: When | None = key(None, "a condition, from which `at` counts")
    every: Positive | None = key(None, "it comes back after so long", "s")
    times: Steps | None = key(None, "so often at most")

    @model_validator(mode="after")
    def _timed(self) -> Event:
        if self.after is not None and self.when is not None:
            raise ValueError("give after, or when, not both")
        if self.at is None and self.after is None and self.when is None:
            raise ValueError("says not when: give at (s), after (the name of another entry), or when (a condition)")
        if self.times is not None and self.every is None:
            raise ValueError("times says how often; give every (s) as well")
        return self

    def faults(self, found: Found) -> list[Fault]:
        """What it does, but for the times: faults from tick 0 to the end."""
        raise NotImplementedError(f"{type(self).__name__} begins nothing")

    @property
    def relative(self) -> bool:
        """Whether `at` counts from something else than the start of the run."""
        return self.after is not None or self.when is not None


class Lasting(Event):
    """What lasts: `until` a time, or for as long as it `lasts`; without either, to the end of the run."""

    until: Positive | None = key(None, "when it ends, counted from the start", "s")
    lasts: Positive | None = key(None, "or how long it lasts; without either to the end of the run", "s")

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
