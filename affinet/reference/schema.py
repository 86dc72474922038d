"""JSON schemas of scenario and study files, for editors: what a key is, its unit, bounds, default, and the names there are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from affinet.planning import registry
from affinet.reference import catalogue
from affinet.reference.entries import Entry
from affinet.scenario.keys import UNIT
from affinet.scenario.profiles import IMPAIRMENTS
from affinet.scenario.sections import Scenario
from affinet.studies import quantities
from affinet.studies.batch import REPORT
from affinet.studies.study import Study
from world.formation import swarms

SCENARIO_FILE, STUDY_FILE = "affinet.schema.json", "affinet.study.schema.json"
_DRAFT = "https://json-schema.org/draft/2020-12/schema"
_CLASS = {"type": "string", "pattern": "^[^:]+:[^:]+$"}
_WORDS = {"number": "number", "whole number": "integer", "true or false": "boolean", "text": "string", "list": "array"}

Schema = dict[str, Any]


def scenario() -> Schema:
    """That of a scenario file."""
    made = _of(Scenario, "A scenario of affinet")
    tables = made["$defs"]
    algorithms = {group: list(catalogue.KINDS[kind]()) for group, kind in _GROUPS.items()}
    for key, group in (("estimator", registry.ESTIMATORS), ("law", registry.LAWS)):
        _name(tables["AgentsSection"]["properties"][key], (entry.name for entry in algorithms[group]))
    every = [entry for entries in algorithms.values() for entry in entries]
    tables["AgentsSection"]["properties"]["parameters"]["properties"] = {e.name: _table(e) for e in every}
    _name(tables["Own"]["properties"]["model"], registry.names(IMPAIRMENTS))
    _only(tables["FormationSection"]["properties"]["preset"], swarms.NAMES)
    return made


def study() -> Schema:
    """That of a study file."""
    made = _of(Study, "A study of affinet")
    names = {"anyOf": [{"enum": list(quantities.NAMES)}, {"type": "string", "pattern": f"^{REPORT}"}]}
    for table in (made["properties"], made["$defs"]["Claim"]["properties"]):
        for key in ("quantity", "to_quantity", "also"):
            if key in table:
                _replace_texts(table[key], names)
    return made


_GROUPS = {registry.ESTIMATORS: "estimators", registry.LAWS: "laws"}


def _of(model: type[BaseModel], title: str) -> Schema:
    made = model.model_json_schema()
    for table in _tables(made):
        for key in table.get("properties", {}).values():
            _say_unit(key)
    return {"$schema": _DRAFT, **made, "title": title}


def _tables(made: Schema) -> Iterator[Schema]:
    yield made
    yield from made.get("$defs", {}).values()


def _say_unit(key: Schema) -> None:
    """In the line that editors show, as no schema has a word for units."""
    if UNIT in key:
        key["description"] = f"{key['description']} [{key.pop(UNIT)}]"


def _name(key: Schema, names: Iterable[str]) -> None:
    """One of these names, or a class of the user's own."""
    del key["type"]
    known = list(names)
    key["anyOf"] = [*([{"enum": known}] if known else []), _CLASS]


def _only(key: Schema, names: Iterable[str]) -> None:
    _replace_texts(key, {"enum": list(names)})


def _replace_texts(key: Schema, by: Mapping[str, Any]) -> None:
    """Give what may be any text the names there are."""
    if key.get("type") == "string":
        del key["type"]
        key.update(by)
    elif key.get("type") == "array":
        key["items"] = dict(by)
    else:
        key["anyOf"] = [dict(by) if one.get("type") == "string" else one for one in key["anyOf"]]


def _table(entry: Entry) -> Schema:
    """The parameters of an estimator or a law."""
    return {
        "type": "object",
        "description": entry.says,
        "properties": {one.name: _parameter(one.kind, one.says, one.default) for one in entry.parameters},
        "required": [one.name for one in entry.parameters if one.required],
        "additionalProperties": False,
    }


def _parameter(kind: str, says: str, default: Any) -> Schema:
    made: Schema = {"description": says}
    if kind in _WORDS:
        made["type"] = _WORDS[kind]
    elif " | " in kind:
        made["enum"] = kind.split(" | ")
    return made if default is None else made | {"default": default}
