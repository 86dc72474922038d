"""All there is of each kind: what comes with affinet, and what installed packages offer."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast

from affinet.planning import registry
from affinet.reference.docstrings import first_line, parameters_of
from affinet.reference.entries import Entry, Parameter, of_model, plain
from affinet.scenario import files, loading, profiles, verbs
from affinet.scenario.events import Lasting
from affinet.scenario.section import Section
from affinet.scenario.sections import Scenario
from affinet.scenario.words import one_line, shown
from affinet.score import card
from affinet.studies import checks, study
from affinet.verdicts.checking import Checker
from affinet.verdicts.invariants import NAMED
from netem.loading.calling import NoSuchAlgorithm, load
from netem.processes.user_code import UserCodeError

# Keys that tell a scenario from others.
_TELLING = {
    "formation": ("preset",),
    "time": ("dt", "duration"),
    "agents": ("estimator", "law"),
    "network": ("availability", "profile"),
}
_MOST = 200  # characters of a default
_CHECKERS: Sequence[Callable[..., Checker]] = tuple(NAMED.values())


def scenarios() -> Iterator[Entry]:
    """Those that come with affinet, with what flies in them."""
    for name in loading.shipped():
        says = files.read(name, "scenarios", "scenario").says
        yield Entry(name, says.get("description", ""), tuple(_told(says)))


def _told(says: Mapping[str, Any]) -> Iterator[Parameter]:
    """What a scenario says of what tells it from others, with the units of its keys."""
    for table, keys in _TELLING.items():
        for key in of_model(cast("type[Section]", Scenario.model_fields[table].annotation)):
            if key.name in keys and key.name in says.get(table, {}):
                yield replace(key, name=f"{table}.{key.name}", required=False, default=says[table][key.name], says="")


def estimators() -> Iterator[Entry]:
    """Estimators by name."""
    return _offered(registry.ESTIMATORS)


def laws() -> Iterator[Entry]:
    """Control laws by name."""
    return _offered(registry.LAWS)


def link_profiles() -> Iterator[Entry]:
    """Profiles of links, with what they are made of; the line is the comment above each."""
    text = (resources.files("affinet.shipped") / "profiles.toml").read_text(encoding="utf-8")
    says = dict(re.findall(r"^# (.*)\n\[(\w+)\]$", text, flags=re.MULTILINE))
    said = {name: line for line, name in says.items()}
    for name, profile in profiles.presets().items():
        made_of = profile.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        yield Entry(name, said.get(name, ""), tuple(_value(key, value) for key, value in made_of.items()))


def impairments() -> Iterator[Entry]:
    """What a profile can do to messages: losses by their model, and the other keys of a profile."""
    for name, model in profiles.LOSSES.items():
        yield Entry(name, first_line(model), tuple(of_model(model)))
    yield from _offered(profiles.IMPAIRMENTS)
    tables: Mapping[str, type[Section]] = {
        "delay": profiles.DelayModel,
        "corrupt": profiles.Corruption,
        "rate": profiles.RateLimit,
    }
    for key in of_model(profiles.LinkProfile):
        if key.name not in ("like", "loss", "netem"):
            yield Entry(key.name, key.says, tuple(of_model(tables[key.name])) if key.name in tables else ())


def verb_entries() -> Iterator[Entry]:
    """Verbs of the timeline, each with its own keys; those that say when stand under the last."""
    when = {key.name for key in of_model(Lasting)}
    for name, model in verbs.VERBS.items():
        yield Entry(name, first_line(model), tuple(key for key in of_model(model) if key.name not in when))
    yield Entry("(any)", "When it happens; what only begins something has no end.", tuple(of_model(Lasting)))


def checker_entries() -> Iterator[Entry]:
    """Checkers: what tests, and `--invariant`, can ask of a run."""
    for made in _CHECKERS:
        yield Entry(made.__name__, first_line(made), tuple(parameters_of(made)))


def studies() -> Iterator[Entry]:
    """Studies that come with affinet, with their axes."""
    for name in study.shipped():
        read = study.load(name)
        axes = (_value(axis.name, list(axis.values)) for axis in read.axes)
        yield Entry(name, f"{read.title} ({read.source})", tuple(axes))


def figures() -> Iterator[Entry]:
    """Figures that a study can draw."""
    return (Entry(name, says) for name, says in checks.FIGURES.items())


def scorecards() -> Iterator[Entry]:
    """Scorecards that come with affinet, with their tasks and airs."""
    for name in files.shipped(card.FOLDER):
        read = card.load(name)
        groups: Mapping[str, Sequence[card.Task | card.Air | card.Worsening]] = {
            "task": read.tasks,
            "air": read.airs,
            "made worse": read.worsenings,
        }
        told = [Parameter(one.name, "", False, kind, "", one.says) for kind, group in groups.items() for one in group]
        yield Entry(name, read.title, tuple(told))


KINDS: Mapping[str, Callable[[], Iterator[Entry]]] = {
    "scenarios": scenarios,
    "estimators": estimators,
    "laws": laws,
    "profiles": link_profiles,
    "impairments": impairments,
    "verbs": verb_entries,
    "checkers": checker_entries,
    "studies": studies,
    "figures": figures,
    "cards": scorecards,
}


def _value(name: str, value: Any) -> Parameter:
    return Parameter(name, "", False, plain(value), "", "")


def _offered(group: str) -> Iterator[Entry]:
    """What installed packages offer; of what cannot be loaded, why."""
    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        package = "?" if point.dist is None else point.dist.name
        try:
            yield _described(point, package)
        except (NoSuchAlgorithm, UserCodeError, NameError, TypeError, ValueError) as error:
            yield Entry(point.name, one_line(f"cannot be loaded: {error}"), package=package)


def _described(point: EntryPoint, package: str) -> Entry:
    algorithm = load(f"{point.module}:{point.attr}", None)
    return Entry(point.name, first_line(algorithm), tuple(parameters_of(algorithm)), package)


def default_of(parameter: Parameter) -> str:
    """The default as a file says it, with its unit; "required" where there is none, and nothing where it may be left out."""
    if parameter.required:
        return f"required, {parameter.unit}" if parameter.unit else "required"
    match parameter.default:
        case None:
            said = ""
        case list(words) if words and all(isinstance(word, str) for word in words):
            said = ", ".join(words)
        case value:
            said = shown(value, _MOST)
    return f"{said} {parameter.unit}".strip()
