"""All faults of a bounded class, said in a line like 'one link, up to 5 s, from any 0.5 s, with cut'."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

from affinet.planning.blueprint import formation_of
from affinet.scenario.sections import Scenario
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError
from affinet.testing.menu import Entry, killed, links
from affinet.testing.trial import Settings, Trial
from world.formation.nominal import Formation

_LIKE = "write it like 'one link, up to 5 s, from any 0.5 s, with cut'"
_NUMBER = r"(\d+(?:\.\d+)?)"
_GRAMMAR = re.compile(
    rf"(?P<number>\w+) (?P<what>\w+), up to (?P<most>{_NUMBER}) s, from any (?P<raster>{_NUMBER}) s"
    r"(?:, with (?P<verb>[\w-]+))?"
)
_NUMBERS = {"one": 1, "two": 2}
_VERBS: Mapping[str, Mapping[str, Entry]] = {
    "link": {"cut": {}, "freeze": {}, "dropout": {"p": 1.0}, "lose": {"loss": 1.0}},
    "edge": {"cut": {}, "freeze": {}, "dropout": {"p": 1.0}, "lose": {"loss": 1.0}},
    "agent": {"kill": {"state": "cold"}, "pause": {}},
}
_TICK = 1e-6  # of a tick: how far from a whole number of them a time may be


@dataclass(frozen=True)
class Every:
    """A class of faults: so many at once of one kind, each time of a raster, for each length on it up to a longest.

    Parameters
    ----------
    number
        How many at once, of the same time and length.
    what
        "link", one way; "edge", both ways; or "agent".
    most, raster
        The longest, and the step of beginnings and lengths, in seconds.
    verb
        What happens to them.
    """

    number: int
    what: str
    most: float
    raster: float
    verb: str

    def __str__(self) -> str:
        number = next(word for word, number in _NUMBERS.items() if number == self.number)
        many = "s" if self.number > 1 else ""
        return f"{number} {self.what}{many}, up to {self.most:g} s, from any {self.raster:g} s, with {self.verb}"

    def those(self, formation: Formation) -> list[tuple[str | int, ...]]:
        """Of which it is made: each one, or each pair."""
        one, edges, _, _ = links(formation)
        each: dict[str, list[str | int]] = {
            "link": [selector for (selector,) in one],
            "edge": [selector for (selector,) in edges],
            "agent": [*range(1, formation.agents + 1)],
        }
        return [*combinations(each[self.what], self.number)]

    def times(self, given: Scenario) -> list[tuple[float, float]]:
        """Beginnings and lengths, in seconds: all that are over when the run is.

        Raises
        ------
        ScenarioError
            When they are no whole ticks, or none fits into the run.
        """
        dt, duration = given.time.dt, given.time.ticks * given.time.dt
        for what, seconds, step in (("from any", self.raster, dt), ("up to", self.most, self.raster)):
            if not seconds or abs(seconds / step - round(seconds / step)) > _TICK:
                unit = "the tick, time.dt" if step is dt else "what it begins at"
                raise ScenarioError(f"--every: {what} {seconds:g} s: give a multiple of {unit}, {step:g} s")
        steps, longest = int(duration / self.raster + _TICK), round(self.most / self.raster)
        if longest > steps:
            raise ScenarioError(f"--every: up to {self.most:g} s: the run is over after {duration:g} s")
        return [
            (round(start * self.raster, 9), round(length * self.raster, 9))
            for length in range(1, longest + 1)
            for start in range(steps - length + 1)
        ]

    def trials(self, scenarios: Mapping[Settings, Scenario], seeds: Sequence[int]) -> Iterator[Trial]:
        """All of them, in every setting and with every seed; the shortest first."""
        for settings, given in scenarios.items():
            those = self.those(formation_of(given))
            for (at, lasts), seed, some in product(self.times(given), seeds, those):
                yield Trial(settings, seed, ([*self._fault(at, lasts, list(some))],))

    def _fault(self, at: float, lasts: float, some: list[str | int]) -> list[Entry]:
        words = {"agents" if self.what == "agent" else "links": some} | _VERBS[self.what][self.verb]
        span: Entry = {"at": at, "lasts": lasts}
        return killed(span, words) if self.verb == "kill" else [{"verb": self.verb} | span | words]


def parse(text: str) -> Every:
    """The class of faults that a text says.

    Raises
    ------
    ScenarioError
        When it says none: in which word.
    """
    if not (match := _GRAMMAR.fullmatch(" ".join(text.split()))):
        raise ScenarioError(f"--every {text!r}: not understood; {_LIKE}")
    number, what = match["number"], match["what"].removesuffix("s")
    if number not in _NUMBERS:
        raise ScenarioError(f"--every {text!r}: {number}: {among(number, _NUMBERS)}")
    if what not in _VERBS:
        raise ScenarioError(f"--every {text!r}: {match['what']}: {among(what, _VERBS)}")
    verb = match["verb"] or next(iter(_VERBS[what]))
    if verb not in _VERBS[what]:
        raise ScenarioError(f"--every {text!r}: with {verb}: of {what}s {among(verb, _VERBS[what])}")
    return Every(_NUMBERS[number], what, float(match["most"]), float(match["raster"]), verb)
