"""Changes to what a scenario file says: texts like `key=value`, as behind --set, and tables and keywords of Python."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

from affinet.scenario import inputs, objects, source, values
from affinet.scenario.bodies import SENSORS
from affinet.scenario.sections import Scenario
from affinet.scenario.words import among, one_line, shown
from affinet.scenario.wrong import ScenarioError

# Words of the command line, and keywords in Python, for the keys that are changed most.
SHORT: Mapping[str, str] = {
    "estimator": "agents.estimator",
    "law": "agents.law",
    "availability": "network.availability",
    "seed": "seed",
    "duration": "time.duration",
    "dt": "time.dt",
}
Given = str | Mapping[str, Any]

_WAYS = "behind --set, or among the overrides in Python"


class Override(NamedTuple):
    """A key, by its parts, the value that it gets, and how both were said."""

    steps: tuple[str, ...]
    value: Any
    says: str

    @property
    def key(self) -> str:
        """The key, with dots."""
        return ".".join(self.steps)


def read(given: Sequence[Given]) -> tuple[Override, ...]:
    """Overrides one by one: of a table each value in it, whose outermost keys may be short, or have dots.

    Raises
    ------
    ScenarioError
        When one is no override, or says what no scenario can.
    """
    return tuple(one for said in given for one in ([_of_text(said)] if isinstance(said, str) else _of_table(said)))


def put(raw: dict[str, Any], overrides: Sequence[Override], folder: Path) -> None:
    """Change what a file says; paths in the overrides are relative to this folder.

    Raises
    ------
    ScenarioError
        When a key leads through something that is no table.
    """
    for one in overrides:
        *tables, name = one.steps
        table: Any = raw
        for step in tables:
            table = table.setdefault(step, {})
            if not isinstance(table, dict):
                raise ScenarioError(f"override {one_line(one.says)}: {step} is not a table")
        if tables == ["sensing"]:
            _make_room(table, name)
        said = reduce(lambda inner, step: {step: inner}, reversed(one.steps), one.value)
        table[name] = reduce(lambda outer, step: outer[step], one.steps, inputs.anchored(said, folder))


def _of_text(text: str) -> Override:
    key, equals, value = text.partition("=")
    steps = tuple(source.parts(key))
    if not equals or not steps[-1]:
        raise ScenarioError(f"override {one_line(text)}: write it as key=value, like network.availability=0.5, {_WAYS}")
    return Override(steps, _value(text, value), text)


def _value(override: str, text: str) -> Any:
    """What the text behind the = says: a value as a file says it, or a word without quotes."""
    try:
        text.encode()
        said = tomllib.loads(f"value = {text}")
    except UnicodeEncodeError as error:
        raise ScenarioError(f"override {one_line(override)}: not UTF-8, as TOML must be") from error
    except (ValueError, RecursionError):
        return text.strip()
    if said.keys() != {"value"}:
        raise ScenarioError(
            f"override {one_line(override)}: it says more than one value; give each key an override of its own"
        )
    return said["value"]


def _of_table(table: Mapping[str, Any]) -> Iterator[Override]:
    for name, value in table.items():
        steps = tuple(source.parts(SHORT.get(str(name), str(name))))
        if steps[0] not in Scenario.model_fields:
            known = [*SHORT, *(key for key in Scenario.model_fields if key not in SHORT)]
            raise ScenarioError(f"override {one_line(str(name))}: no such key; {among(name, known)}")
        yield from _leaves(steps, value)


def _leaves(steps: tuple[str, ...], value: Any) -> Iterator[Override]:
    """The values of a table within tables; it adds to what is there, and a list takes the place of one."""
    key = ".".join(steps)
    if isinstance(value, Mapping) and value:
        for name, inner in value.items():
            yield from _leaves((*steps, str(name)), inner)
    elif key in objects.KEYS and not isinstance(value, str):
        name, parameters = objects.said(key, value)
        yield Override(steps, name, f"{key}={name}")
        yield Override(("agents", "parameters", name), parameters, f"agents.parameters.{name}={shown(parameters)}")
    else:
        said = _plain(key, value)
        yield Override(steps, said, f"{key}={shown(said)}")


def _plain(key: str, value: Any) -> Any:
    try:
        return values.plain(value)
    except TypeError as error:
        raise ScenarioError(f"override {one_line(key)}: {one_line(str(error))}") from error


def _make_room(sensing: dict[str, Any], name: str) -> None:
    """Leave out what a file says of another sensor than the one that this key is of."""
    own = [kind for kind in SENSORS if name in kind]
    for other in (key for kind in SENSORS if own and kind not in own for key in kind):
        sensing.pop(other, None)
