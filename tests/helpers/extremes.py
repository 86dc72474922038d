"""Scenarios in which every number that a scenario can hold is said, and where each of them stands."""

from collections.abc import Iterator
from inspect import get_annotations
from typing import Any, get_args

from affinet.scenario.section import Section
from affinet.scenario.sections import Scenario

SHORT = {"dt": 0.05, "duration": 0.25, "patience": 3.0}
SQUARE = [[1.0, 0.0], [0.0, 1.0]]

_LOSSES: dict[str, dict[str, Any]] = {
    "bernoulli": {"p": 0.1},
    "gilbert": {"loss": 0.1, "burst": 2.0, "extra_delay": 0.1},
    "gilbert-elliott": {"p": 0.1, "r": 0.5, "bad": 0.9, "good": 0.1, "extra_delay": 0.1},
    "markov": {"p13": 0.1, "p31": 0.5, "p32": 0.1, "p23": 0.1, "p14": 0.1},
    "bursts": {"loss": 0.1, "lengths": [0.5, 0.5]},
    "list": {"messages": [0, 2]},
    "disk": {"range": 100.0},
    "ramp": {"inner": 10.0, "outer": 100.0},
    "log-distance": {"range": 100.0, "exponent": 3.0, "shadowing": 4.0, "coherence": 0.1},
    "round-robin": {"hold": 1},
    "slotted": {"hold": 1},
    "duty-cycle": {"period": 4, "on": 3},
}
# Of profiles that no link has: no file is read.
_TRACED = {"model": "trace", "file": "field.txt", "agents": {"a": 1, "b": 2}, "begins": 1.0, "interval": 0.5}
_BY_CURVE = {"model": "trace", "file": "field.txt", "first": 0, "curve": [[-90.0, 0.0], [-70.0, 1.0]]}
_WAITS = {"delay": {"model": "trace", "trace": {"file": "d.csv"}}, "rate": {"trace": {"file": "r.csv", "first": 0}}}
_DELAYS: dict[str, dict[str, Any]] = {
    "constant": {"mean": 0.1},
    "uniform": {"mean": 0.1, "jitter": 0.05},
    "normal": {"mean": 0.1, "jitter": 0.05, "correlation": 0.5},
    "exponential": {"mean": 0.1},
    "pareto": {"mean": 0.1, "jitter": 0.05},
    "table": {"table": [0.05, 0.1]},
}
_RULED = ["1-2", "1-3", "1-4", "1-5", "2-4", "2-7", "3-5", "3-6", "4-5", "4-6", "5-7", "6-7"]
_WEIGHTS = [4.0, 4.0, -2.0, -2.0, 8.0, -2.0, 8.0, -2.0, 1.0, 4.0, 4.0, 2.0]  # the stress of zhao7
_PROFILES: dict[str, dict[str, Any]] = {
    **{f"loss-{model}": {"loss": [{"model": model, **keys}]} for model, keys in _LOSSES.items()},
    **{f"delay-{model}": {"delay": {"model": model, **keys}} for model, keys in _DELAYS.items()},
    "rest": {
        "duplicate": 0.1,
        "reorder": 0.1,
        "corrupt": [{"kind": "bias", "p": 0.1, "by": 1.0}, {"kind": "bit-flip", "p": 0.1}],
        "rate": {"rate": 1e5, "queue": 10_000, "burst": 1000},
    },
}
_FAULTS: list[dict[str, Any]] = [
    {"verb": "cut", "links": ["1->2"], "at": 0.05, "lasts": 0.05, "every": 0.1, "times": 2},
    {"verb": "partition", "groups": [[1, 2, 3], [4, 5, 6, 7]], "at": 0.05, "until": 0.1},
    {"verb": "lose", "links": ["1->2"], "at": 0.0, "loss": 0.5},
    {"verb": "delay", "links": ["2->1"], "at": 0.0, "delay": 0.05},
    {"verb": "degrade", "links": ["2->1"], "at": 0.1, "profile": "rest"},
    {"verb": "heal", "at": 0.2},
    {"verb": "kill", "agents": [7], "at": 0.05},
    {"verb": "restart", "agents": [7], "at": 0.15},
    {"verb": "pause", "agents": [6], "at": 0.05},
    {"verb": "resume", "agents": [6], "at": 0.1},
    {"verb": "clock", "agents": [1], "at": 0.0, "rate": 0.5},
    {"verb": "depart", "agents": [5], "at": 0.05},
    {"verb": "rejoin", "agents": [5], "at": 0.1},
    {"verb": "depart", "agents": [4], "at": 0.05},
    {"verb": "replace", "agents": [4], "at": 0.1},
    {"verb": "gust", "agents": [6], "at": 0.0, "velocity": [1.0, 0.0]},
    {"verb": "bias", "links": ["1->2"], "at": 0.0, "by": [1.0, 0.0]},
    {"verb": "outlier", "links": ["1->3"], "at": 0.0, "p": 0.5, "sigma": 10.0},
    {"verb": "dropout", "links": ["1->4"], "at": 0.0, "p": 0.5},
    {"verb": "freeze", "links": ["1->5"], "at": 0.05},
    {"verb": "lie", "agents": [3], "at": 0.0, "matrix": [[2.0, 0.0], [0.0, 1.0]]},
    {"verb": "cut", "links": ["3->1"], "when": {"tracking_error_below": 0.001, "lasting": 0.05}, "at": 0.05},
    {"verb": "cut", "links": ["1->3"], "when": {"tracking_error_above": 100.0, "lasting": 0.05}},
]
_TIMER = {"agents": [1], "rate": 1.0, "phase": 0.2, "jitter": 0.1, "drift": 0.1, "listens": 0.4}
_FLOWN: dict[str, Any] = {
    "formation": {
        "nodes": [[2.0, 0.0], [1.0, 1.0], [1.0, -1.0], [0.0, 1.0], [0.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]],
        "edges": _RULED,
        "leaders": [1, 2, 3],
        "scale": 2.0,
        "spread": 0.5,
    },
    "manoeuvre": {
        "keyframes": [
            {"time": 0.0, "theta": SQUARE, "offset": [0.0, 0.0], "angle": 0.1},
            {"time": 0.2, "theta": SQUARE, "offset": [1.0, 0.0], "angle": 0.2},
        ],
        "walls": [[[0.0, 1.0], [2.0, 3.0]]],
    },
    "time": {**SHORT, "real": {"factor": 1.0, "late": 1.0, "timers": [_TIMER]}},
    "sensing": {"samples": 2, "sigma": 0.1},
    "agents": {"estimator": "ga-rkf", "law": "varying-velocity", "leader_gain": 1.0, "limit": 5.0, "per_process": 2},
}
# The same keys, otherwise said; together they say them all.
BASES: dict[str, dict[str, Any]] = {
    "swarm": {
        **_FLOWN,
        "seed": 1,
        "dynamics": {"disturbance": 0.01, "persistence": 0.5, "kernel": {"shape": "exponential", "length": 2.0}},
        "trust": {"largest_message": 4096, "messages_per_tick": 50},
        "record": {"every": 5, "window": 0.1},
    },
    "air": {
        **_FLOWN,
        "network": {
            "availability": 0.9,
            "delay_ticks": 1,
            "coupled": False,
            "profiles": _PROFILES,
            "links": [
                *({"links": edge, "profile": name} for edge, name in zip(_RULED, _PROFILES, strict=False)),
                *({"links": edge, "profile": name} for edge, name in zip(_RULED, [*_PROFILES][12:], strict=False)),
                {"links": "5->1", "availability": 0.5, "delay_ticks": 2},
            ],
            "zones": [{"centre": [0.0, 0.0], "radius": 1.0, "share": 0.5}],
        },
    },
    "traces": {
        **_FLOWN,
        "network": {"profiles": {"one": {"loss": [_TRACED]}, "other": {"loss": [_BY_CURVE]}, "waits": _WAITS}},
    },
    "timeline": {**_FLOWN, "network": {"profiles": {"rest": _PROFILES["rest"]}}, "timeline": _FAULTS},
    "covariances": {
        **_FLOWN,
        "sensing": {"covariance": [[0.01, 0.001], [0.001, 0.01]]},
        "dynamics": {"covariance": [[0.01, 0.001], [0.001, 0.01]]},
    },
    "weights": {**_FLOWN, "formation": {**_FLOWN["formation"], "weights": _WEIGHTS}},
    "directed": {**_FLOWN, "formation": {**_FLOWN["formation"], "weights": [[weight, weight] for weight in _WEIGHTS]}},
    "unicycles": {
        **_FLOWN,
        "dynamics": {"model": "unicycle", "ahead": 0.3},
        "agents": {"estimator": "rkf", "law": "static"},
    },
    "polar": {
        **_FLOWN,
        "sensing": {"sigma_range": 0.1, "sigma_bearing": 0.01},
        "agents": {"estimator": "rkf", "law": "static"},
    },
    "directions": {
        **_FLOWN,
        "sensing": {"sigma_direction": 0.01},
        "agents": {"estimator": "edge-kf", "law": "static"},
    },
    "line-of-sight": {
        **_FLOWN,
        "sensing": {"sigma_along": 0.1, "sigma_across": 0.1},
        "agents": {"estimator": "jor", "law": "rest"},
    },
    "target": {
        **_FLOWN,
        "formation": {"nodes": _FLOWN["formation"]["nodes"], "edges": _RULED, "leaders": []},
        "dynamics": {"model": "double-integrator"},
        "target": {
            "order": 2,
            "intensity": 1.0,
            "true_intensity": 0.5,
            "position": [0.0, 0.0],
            "velocity": [1.0, 0.0],
            "latencies": [0.1, 0.05],
            "variances": [0.01, 0.1],
            "probabilities": [0.5, 0.5],
            "misses": 0.1,
            "false_positives": 0.1,
            "clutter": 5.0,
        },
        "agents": {"estimator": "target", "law": "pursuit"},
    },
    "target on a path": {
        **_FLOWN,
        "formation": {"nodes": _FLOWN["formation"]["nodes"], "edges": _RULED, "leaders": []},
        "dynamics": {"model": "double-integrator"},
        "target": {
            "path": [{"time": 0.0, "position": [0.0, 0.0]}, {"time": 0.2, "position": [1.0, 0.0]}],
            "latencies": [0.1],
            "variances": [0.01],
            "schedule": [1, 1],
        },
        "agents": {"estimator": "target", "law": "pursuit"},
    },
    "target seen by each in its own way": {
        **_FLOWN,
        "formation": {"nodes": _FLOWN["formation"]["nodes"], "edges": _RULED, "leaders": []},
        "dynamics": {"model": "double-integrator"},
        "target": {"latencies": [0.1, 0.05], "variances": [0.01, 0.1], "methods": [1, 2, 1, 2, 1, 2, 1]},
        "agents": {"estimator": "target", "law": "pursuit"},
    },
}

Place = tuple[str | int, ...]


def numbers(section: Section, path: Place = ()) -> Iterator[tuple[Place, str]]:
    """Where numbers stand in a scenario, and which field of which section each is."""
    for name in type(section).model_fields:
        yield from _inside(getattr(section, name), (*path, name), f"{_declared_in(type(section), name)}.{name}")


def _declared_in(section: type[Section], name: str) -> str:
    return next(kind.__name__ for kind in section.__mro__ if name in get_annotations(kind))


def _inside(value: Any, path: Place, field: str) -> Iterator[tuple[Place, str]]:
    match value:
        case Section():
            yield from numbers(value, path)
        case list():
            for place, each in enumerate(value):
                yield from _inside(each, (*path, place), field)
        case dict():
            for name, each in value.items():
                yield from _inside(each, (*path, name), field)
        case int() | float() if not isinstance(value, bool):
            yield path, field


def numeric_fields() -> set[str]:
    """All fields of sections of a scenario that can hold a number."""
    return {
        f"{section.__name__}.{name}"
        for section in _sections(Section)
        if section.__module__.startswith("affinet.scenario.")
        for name, field in section.model_fields.items()
        if _numeric(field.annotation) and _declared_in(section, name) == section.__name__
    }


def _sections(kind: type[Section]) -> Iterator[type[Section]]:
    for section in kind.__subclasses__():
        yield section
        yield from _sections(section)


def _numeric(annotation: Any) -> bool:
    return annotation in (int, float) or any(_numeric(each) for each in get_args(annotation))


def changed(base: dict[str, Any], path: Place, value: Any) -> dict[str, Any]:
    """What a file says, with another value at a place."""
    first, *rest = path
    copy: Any = base.copy()
    copy[first] = changed(copy[first], tuple(rest), value) if rest else value
    return copy


def places(base: dict[str, Any]) -> list[tuple[Place, str]]:
    """The numbers of a base: one of each list of numbers stands for all."""
    found: dict[tuple[Any, ...], tuple[Place, str]] = {}
    for path, field in numbers(Scenario.model_validate(base)):
        steps: Any = base
        try:
            for step in path:
                steps = steps[step]
        except (KeyError, IndexError):
            continue  # a default
        alike = tuple(step for step in path if not isinstance(step, int))
        found.setdefault((field, *alike), (path, field))
    return list(found.values())
