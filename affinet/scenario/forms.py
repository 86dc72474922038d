"""The right form of a key, by example: what its type asks for, in the words of a TOML file."""

from __future__ import annotations

import types
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from affinet.scenario.words import shown

# Where the type alone does not say what is meant, by the `path` of a `Place`.
EXAMPLES: Mapping[str, Any] = {
    "description": "what it is about",
    "also": ["nees"],
    "formation.preset": "zhao7",
    "formation.file": "swarm.graphml",
    "formation.fields.x": "px",
    "formation.fields.y": "py",
    "formation.fields.z": "pz",
    "formation.fields.leader": "anchor",
    "manoeuvre.file": "path.csv",
    "formation.nodes": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
    "formation.edges": ["1-2", "2-3"],
    "formation.leaders": [1, 2, 3],
    "formation.weights": [1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
    "manoeuvre": {"preset": "hover"},
    "manoeuvre.keyframes.offset": [0.0, 0.0],
    "manoeuvre.walls": [[[19.0, 4.0], [19.0, 1.4], [25.0, 1.4], [25.0, 4.0]]],
    "target.path": [{"time": 0.0, "position": [0.0, 0.0]}, {"time": 10.0, "position": [5.0, 0.0]}],
    "target.path.position": [0.0, 0.0],
    "time": {"dt": 0.01, "duration": 60.0},
    "time.dt": 0.01,
    "time.duration": 60.0,
    "time.real.timers": [{"agents": [4], "phase": 0.5}],
    "time.real.timers.agents": [4, "leaders"],
    "sensing": {"sigma": 0.1},
    "sensing.covariance": [[0.01, 0.0], [0.0, 0.01]],
    "dynamics.covariance": [[0.01, 0.0], [0.0, 0.01]],
    "agents": {"estimator": "rkf", "law": "varying-velocity"},
    "agents.estimator": "rkf",
    "agents.law": "varying-velocity",
    "agents.programs": {"3": "python my_agent.py"},
    "agents.parameters": {"rkf": {"sigma_w": 0.5}},
    "agents.parameters.*": {"sigma_w": 0.5},
    "formation": {"preset": "zhao7"},
    "recorded": {"flight": "outdoor.csv"},
    "recorded.flight": "outdoor.csv",
    "external": {"driver": "python driver.py"},
    "external.driver": "python driver.py",
    "network.profile": "wifi_busy",
    "network.profiles": {"mine": {"loss": [{"model": "bernoulli", "p": 0.1}]}},
    "network.profiles.*": {"loss": [{"model": "bernoulli", "p": 0.1}]},
    "network.profiles.*.like": "wifi_busy",
    "network.profiles.*.netem": "delay 100ms loss 1%",
    "network.profiles.*.loss.file": "trace.csv",
    "network.profiles.*.loss.format": "ping",
    "network.profiles.*.loss.agents": {"uav1": 1, "uav2": 2},
    "network.profiles.*.loss.curve": [[-90.0, 0.0], [-70.0, 1.0]],
    "network.profiles.*.corrupt": [{"kind": "nan", "p": 0.1}],
    "network.profiles.*.delay": {"model": "constant", "mean": 0.05},
    "network.profiles.*.delay.table": [0.01, 0.05],
    **{
        f"network.profiles.*.{table}.trace{key}": said
        for table in ("delay", "rate")
        for key, said in (
            ("", {"file": "links.csv"}),
            (".file", "links.csv"),
            (".format", "table"),
            (".agents", {"uav1": 1, "uav2": 2}),
            (".curve", [[-90.0, 0.0], [-70.0, 1.0]]),
        )
    },
    "network.profiles.*.rate": {"rate": 1e6},
    "network.links.links": "1->2",
    "network.links.profile": "wifi_busy",
    "network.zones.links": "all",
    "network.zones.centre": [0.0, 0.0],
    "trust.largest_message": 1 << 20,
    "trust.messages_per_tick": 100,
    "timeline": [{"verb": "cut", "at": 1.0, "links": ["1-2"]}],
    "timeline.name": "first",
    "timeline.at": 1.0,
    "timeline.after": "first.end",
    "timeline.when": {"tracking_error_below": 0.05},
    "timeline.until": 2.0,
    "timeline.links": ["1-2", "2->4"],
    "timeline.agents": [4, "leaders"],
    "timeline.groups": [[1, 2, 3], [4, 5, 6, 7]],
    "timeline.profile": "wifi_busy",
    "timeline.names": ["first"],
    "timeline.by": [0.5, 0.0],
    "timeline.velocity": [0.5, 0.0],
    "timeline.matrix": [[2.0, 0.0], [0.0, 2.0]],
    # of studies
    "title": "Loss against error",
    "source": "our own",
    "scenario": "corridor",
    "set": ["time.dt=0.05"],
    "full": {"runs": 50},
    "quick": {"runs": 5},
    "full.set": ["time.duration=10"],
    "quick.set": ["time.duration=5"],
    "along": "loss",
    "quantity": "error",
    "claims.quantity": "error",
    "claims.to_quantity": "error",
    "bound": {"at": 0.5, "says": "what the paper allows"},
    "axes": [{"name": "law", "values": {"static": ['agents.law="static"'], "as it is": []}}],
    "axes.name": "law",
    "axes.values": {"static": ['agents.law="static"'], "as it is": []},
    "axes.values.*": ['agents.law="static"'],
    "skip": [{"law": "static"}],
    "claims": [{"says": "losses cost little", "check": "flat", "level": 2.0}],
    "claims.says": "losses cost nothing",
    "claims.each": ["law"],
    "claims.of": {"law": "static"},
    "claims.to": {"law": "static"},
    "claims.levels": {"static": 0.5},
    "claims.between": [0.9, 1.1],
}
_LISTS = (list, tuple, Sequence)
_NUMBERS = (1.0, 0.5, 2.0, 0.0)


class Place(NamedTuple):
    """A key of a file.

    Parameters
    ----------
    key
        As people write it, with numbers from 1.
    path
        The names that lead to it, without numbers; "*" for each that the user gave.
    kind
        The type that it should have.
    """

    key: str
    path: str
    kind: Any


def place(model: type[BaseModel], loc: tuple[str | int, ...]) -> Place:
    """The key at a place of a model, as pydantic says where an error is."""
    kind: Any = model
    keys: list[str] = []
    names: list[str] = []
    for step in loc:
        members = choices(kind)
        kind = bare(kind)
        if len(members) > 1 and isinstance(step, str):  # says which of them it was taken for, and is no key
            kind = _member(members, step)
            continue
        keys.append(str(step + 1) if isinstance(step, int) else step)
        if _is_model(kind):
            names.append(str(step))
            field = kind.model_fields.get(step)
            kind = Any if field is None else annotated(field)
        else:
            names += ["*"] * (get_origin(kind) is dict)
            kind = next((one for one in reversed(get_args(kind)) if one is not ...), Any)
    return Place(".".join(keys), ".".join(names), kind)


def union(model: type[BaseModel], loc: tuple[str | int, ...]) -> int | None:
    """Which step of a place says what the value was taken for, where it could be one of several types without a tag."""
    for depth in range(len(loc)):
        members = choices(place(model, loc[:depth]).kind)
        if len(members) > 1 and not all(map(_is_model, members)):
            return depth
    return None


def annotated(field: FieldInfo) -> Any:
    """The type of a field with all that restricts it."""
    return Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation


def bare(kind: Any) -> Any:
    """A type without what restricts it, and without None."""
    members = choices(kind)
    return members[0] if len(members) == 1 else kind


def choices(kind: Any) -> tuple[Any, ...]:
    """The types of which it is one; several for a union."""
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if get_origin(kind) not in (Union, types.UnionType):
        return (kind,)
    return tuple(one for member in get_args(kind) if member is not type(None) for one in choices(member))


def tags(kind: Any, tag: str) -> list[str]:
    """The words by which a table says which of several kinds it is."""
    return [word for member in choices(kind) for word in get_args(member.model_fields[tag].annotation)]


def form(kind: Any, path: str) -> str:
    """What is asked for, and an example."""
    said = list(dict.fromkeys(_what(member) for member in choices(kind)))
    if "one of" in said:
        return f"one of {', '.join(map(repr, get_args(bare(kind))))}"
    shape = example(kind, path)
    return " or ".join(said) + ("" if shape is None else f", like {shown(shape, 120)}")


def example(kind: Any, path: str) -> Any:
    """A value of this type, for the key at this path; None where there is nothing to say."""
    if path in EXAMPLES:
        known = EXAMPLES[path]
        return known if _fits(kind, known) else next((item for item in _items(known) if _fits(kind, item)), None)
    first = choices(kind)[0]
    if get_origin(first) is Literal:
        return get_args(first)[0]
    if _is_model(first):
        return {
            name: example(annotated(field), f"{path}.{name}".lstrip("."))
            for name, field in first.model_fields.items()
            if field.is_required()
        }
    if get_origin(first) in _LISTS:
        inner = get_args(first)[0]
        if get_origin(bare(inner)) is list:
            return [[1.0, 0.0], [0.0, 1.0]]
        return [example(inner, path)]
    if get_origin(first) is dict:
        return {"name": example(get_args(first)[1], f"{path}.*")}
    return _scalar(kind, first)


def _scalar(kind: Any, first: Any) -> Any:
    if first is bool:
        return True
    if first in (int, float):
        return next((first(number) for number in _NUMBERS if _fits(kind, first(number))), None)
    return "text" if first is str else None


def _items(known: Any) -> list[Any]:
    inner = list(known.values() if isinstance(known, dict) else known) if isinstance(known, dict | list) else []
    return [*inner, *(deeper for one in inner for deeper in _items(one))]


def _fits(kind: Any, value: Any) -> bool:
    try:
        TypeAdapter(kind).validate_python(value, strict=True)
    except ValidationError:
        return False
    return True


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def _what(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return "one of"
    if _is_model(kind) or get_origin(kind) is dict:
        return "a table"
    if get_origin(kind) in _LISTS:
        return "a list"
    return {float: "a number", int: "a whole number", bool: "true or false", str: "text in quotes"}.get(
        kind, "something else"
    )


def _member(members: tuple[Any, ...], label: str) -> Any:
    for member in members:
        if _is_model(member):
            said = [get_args(field.annotation) for field in member.model_fields.values()]
            if label == member.__name__ or any(label in words for words in said):
                return member
        elif label.startswith(getattr(get_origin(member) or member, "__name__", "?")):
            return member
    return members[0]
