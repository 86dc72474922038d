"""Timeline section -> faults in ticks: selectors looked up, times counted from what they are relative to, ends found.

Times are seconds in a frame: that of the run, or of a trigger, until it fires. What ends a fault must share its frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from affinet.scenario import profiles, selectors, verbs
from affinet.scenario.events import Event, Found, Lasting, When
from affinet.scenario.sections import Scenario
from affinet.scenario.selectors import ChoiceKey
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError, said_at
from netem.core.links import Links
from netem.faults.fault import Fault, Pairs, Verb
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger
from world.formation.nominal import Formation

_ENDED_BY = {"restart": Verb.KILL, "resume": Verb.PAUSE, "rejoin": Verb.DEPART, "replace": Verb.DEPART}
_MOST_FAULTS = 10_000
_ON_LINKS = (Verb.CUT, Verb.PARTITION, Verb.LOSE, Verb.DELAY, Verb.DEGRADE)


@dataclass(frozen=True)
class Script:
    """The faults of a scenario.

    Parameters
    ----------
    faults
        In ticks.
    triggers
        Those that some of them wait for.
    profiles
        Names of the profiles to which links are degraded, and the keys that name them.
    """

    faults: tuple[Fault, ...]
    triggers: tuple[Trigger, ...]
    profiles: tuple[tuple[str, str], ...]


class Instant(NamedTuple):
    """A time in seconds, in the frame of a trigger, or of the run."""

    frame: int | None
    seconds: float


@dataclass
class _Draft:
    """A script in the making."""

    given: Scenario
    formation: Formation
    links: Links
    faults: list[tuple[int, Fault]] = field(default_factory=list)  # with the number of the entry, from 0
    triggers: list[Trigger] = field(default_factory=list)
    profiles: list[tuple[str, str]] = field(default_factory=list)
    begins: dict[int, Instant] = field(default_factory=dict)

    @property
    def entries(self) -> Sequence[Event]:
        return self.given.timeline

    def ticks(self, seconds: float) -> int:
        return round(seconds / self.given.time.dt)


def write(given: Scenario, formation: Formation, links: Links) -> Script:
    """The faults of a scenario.

    Raises
    ------
    ScenarioError
        When an entry names what does not exist, or ends what has not begun.
    """
    draft = _Draft(given, formation, links)
    for number in range(len(draft.entries)):
        with said_at(f"timeline.{number + 1}"):
            draft.begins[number] = _begin(draft, number, ())
    for number, entry in enumerate(draft.entries):
        if not _ends(entry):
            _add(draft, number, entry)
    for number in sorted(range(len(draft.entries)), key=lambda n: draft.begins[n].seconds):
        if _ends(draft.entries[number]):
            with said_at(f"timeline.{number + 1}"):
                _end(draft, number, draft.entries[number])
    faults = tuple(fault for _, fault in draft.faults)
    return Script(faults, tuple(draft.triggers), tuple(draft.profiles))


def _ends(entry: Any) -> bool:
    return isinstance(entry, verbs.Heal) or entry.verb in _ENDED_BY


def _begin(draft: _Draft, number: int, asking: tuple[int, ...]) -> Instant:
    """When an entry first begins."""
    if number in draft.begins:
        return draft.begins[number]
    entry = draft.entries[number]
    if number in asking:
        raise ValueError("entries begin after each other in a circle")
    if entry.when is not None:
        draft.triggers.append(_trigger(draft, entry.when))
        return Instant(len(draft.triggers) - 1, entry.at or 0.0)
    if entry.after is None:
        return Instant(None, entry.at or 0.0)
    name, dot, end = entry.after.partition(".")
    named = [n for n, other in enumerate(draft.entries) if other.name == name]
    if len(named) != 1 or (dot and end != "end"):
        raise ValueError(
            f"after {entry.after!r}: name one entry, or its end as '{name}.end'; {len(named)} are called {name!r}"
            f"{'' if named else _called(draft, name)}"
        )
    moment = _begin(draft, named[0], (*asking, number))
    draft.begins.setdefault(named[0], moment)
    lasts = _length(draft.entries[named[0]], moment) if dot else 0.0
    return Instant(moment.frame, moment.seconds + lasts + (entry.at or 0.0))


def _called(draft: _Draft, name: str) -> str:
    names = list(dict.fromkeys(entry.name for entry in draft.entries if entry.name is not None))
    return f"; {among(name, names)}" if names else '; no entry has a name: give one its name = "..."'


def _trigger(draft: _Draft, when: When) -> Trigger:
    ticks = max(1, draft.ticks(when.lasting))
    if when.tracking_error_above is not None:
        return Trigger(when.tracking_error_above, True, ticks)
    return Trigger(float(when.tracking_error_below or 0.0), False, ticks)


def _length(entry: Event, begin: Instant) -> float:
    if isinstance(entry, Lasting) and entry.lasts is not None:
        return entry.lasts
    if isinstance(entry, Lasting) and entry.until is not None:
        return entry.until - begin.seconds
    raise ValueError(f"{entry.name!r} says itself neither until when nor how long it lasts")


def _occurrences(draft: _Draft, number: int, entry: Event) -> Iterator[tuple[Instant, int, int | None]]:
    """When it begins, each time, the tick in which it does, and the first in which it holds no longer."""
    first, again, dt = draft.begins[number], 0, draft.given.time.dt
    if entry.every is not None and entry.every < dt:
        raise ValueError(f"every {entry.every:g} s is less than a tick of {dt:g} s; give at least that")
    while again == 0 or (entry.every is not None and again < (entry.times or again + 1)):
        seconds = first.seconds + again * (entry.every or 0.0)
        if again and draft.ticks(seconds) >= draft.given.time.ticks:
            return
        end = None
        if isinstance(entry, Lasting) and (entry.lasts is not None or entry.until is not None):
            end = draft.ticks(seconds + _length(entry, first))
        yield Instant(first.frame, seconds), draft.ticks(seconds), end
        again += 1


def _add(draft: _Draft, number: int, entry: Event) -> None:
    key = f"timeline.{number + 1}"
    shapes = _shapes(draft, number, entry, key)
    with said_at(key):
        for moment, start, end in _occurrences(draft, number, entry):
            if end is not None and end <= start:
                raise ValueError(f"lasts no tick of {draft.given.time.dt:g} s; let it last at least that")
            draft.faults += [(number, replace(shape, trigger=moment.frame, start=start, end=end)) for shape in shapes]
            if len(draft.faults) > _MOST_FAULTS:
                raise ValueError(
                    f"makes more than {_MOST_FAULTS} faults of the timeline; lengthen every, or give times"
                )
        Timeline(draft.links, [replace(shape, trigger=None) for shape in shapes])


def _shapes(draft: _Draft, number: int, entry: Any, key: str) -> list[Fault]:
    """The faults of an entry, without their times."""
    choice, formation = ChoiceKey(draft.given.seed, number + 1), draft.formation

    def on(named: Sequence[str]) -> Pairs:
        with said_at(f"{key}.links"):
            return selectors.pairs(named, formation, draft.links, choice)

    def whom(named: Sequence[int | str]) -> tuple[int, ...]:
        with said_at(f"{key}.agents"):
            return selectors.agents(named, formation, choice)

    def groups(split: list[list[int]] | str) -> tuple[tuple[int, ...], ...]:
        return tuple(map(tuple, split if isinstance(split, list) else selectors.groups(split, formation)))

    def numbers(name: str) -> tuple[Any, ...]:
        said, dimension = getattr(entry, name), formation.dimension
        if len(said) != dimension:
            needs = f"must be {dimension} x {dimension}" if isinstance(said[0], list) else f"needs {dimension}"
            raise ScenarioError(f"{key}.{name}: {needs} numbers")
        return tuple(tuple(row) if isinstance(row, list) else row for row in said)

    def profile(name: str) -> int:
        return _profile(draft, name, f"{key}.profile")

    says_positions = draft.given.sensing.sigma_direction is None
    with said_at(key):
        shapes: list[Fault] = entry.faults(Found(on, whom, groups, numbers, profile, says_positions))
    return shapes


def _profile(draft: _Draft, name: str, key: str) -> int:
    names = [known for known, _ in draft.profiles]
    if name not in names:
        with said_at(key):
            profiles.resolve(name, draft.given.network.profiles)
        draft.profiles.append((name, key))
        names.append(name)
    return names.index(name) + 1


def _end(draft: _Draft, number: int, entry: Any) -> None:
    """End what was begun: of links, or of agents one by one."""
    for moment, tick, _ in _occurrences(draft, number, entry):
        if isinstance(entry, verbs.Heal):
            _heal(draft, entry, moment, tick)
            continue
        verb = _ENDED_BY[entry.verb]
        for agent in _whose(draft, number, entry, verb, moment.frame, tick):
            begun = [
                place
                for place, (_, fault) in enumerate(draft.faults)
                if fault.verb is verb and fault.agents == (agent,) and _open(fault, moment.frame, tick)
            ]
            if not begun:
                raise ValueError(
                    f"agent {agent} is under no {verb} then, in the same frame of time, that this could end"
                )
            warm = isinstance(entry, verbs.Restart) and entry.state == "warm"
            for place in begun:
                _close(draft, place, tick, warm)
            if isinstance(entry, verbs.Replace):
                # The process that left ends in the last tick of its absence: what begins then is a new one.
                draft.faults.append((number, Fault(Verb.KILL, tick - 1, tick, trigger=moment.frame, agents=(agent,))))


def _whose(draft: _Draft, number: int, entry: Any, verb: Verb, frame: int | None, tick: int) -> tuple[int, ...]:
    if entry.agents is None:
        under = {fault.agents[0] for _, fault in draft.faults if fault.verb is verb and _open(fault, frame, tick)}
        if not under:
            raise ValueError(f"nobody is under {verb} then, in the same frame of time, that this could end")
        return tuple(sorted(under))
    with said_at(f"timeline.{number + 1}.agents"):
        return selectors.agents(entry.agents, draft.formation, ChoiceKey(draft.given.seed, number + 1))


def _heal(draft: _Draft, entry: verbs.Heal, moment: Instant, tick: int) -> None:
    known = {other.name for other in draft.entries}
    if missing := [name for name in entry.names or [] if name not in known]:
        raise ValueError(f"names: no entry is called {', '.join(map(repr, missing))}{_called(draft, missing[0])}")
    begun = [
        place
        for place, (number, fault) in enumerate(draft.faults)
        if fault.verb in _ON_LINKS
        and (entry.names is None or draft.entries[number].name in entry.names)
        and _open(fault, moment.frame, tick)
    ]
    if not begun:
        raise ValueError("nothing on links is under way then, in the same frame of time, that this could heal")
    for place in begun:
        _close(draft, place, tick, warm=False)


def _open(fault: Fault, frame: int | None, tick: int) -> bool:
    return fault.trigger == frame and fault.start < tick and (fault.end is None or tick < fault.end)


def _close(draft: _Draft, place: int, tick: int, warm: bool) -> None:
    number, fault = draft.faults[place]
    draft.faults[place] = number, replace(fault, end=tick, warm=warm)
