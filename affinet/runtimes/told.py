"""What a process of a run may tell the launcher: a line of JSON, of an event that is its role's own. All else is no order."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from netem.wire.wrong import Wrong

Event = dict[str, Any]
Check = Callable[[Any], bool]

LONGEST_LINE = 1 << 20
_SHOWN = 120
_KEY = re.compile(r"[\w/-]{1,200}", re.ASCII)
_WRONG = frozenset(map(str, Wrong))


class NotItsOwn(ValueError):
    """What was wrong with a line, and what might have been said."""


class Beat(NamedTuple):
    """What a process does: the tick it is in, and who owes it what, if it waits."""

    tick: int
    what: str
    waits: tuple[str, ...]


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value < 1 << 63


def _is_text(value: Any) -> bool:
    return type(value) is str


def _is_key(value: Any) -> bool:
    return type(value) is str and _KEY.fullmatch(value) is not None


def _is_number(value: Any) -> bool:
    return type(value) is float


def _is_refusal(value: Any) -> bool:
    if type(value) is not list or len(value) != 3:
        return False
    agent, wrong, count = value
    return (agent is None or _is_count(agent)) and _is_text(wrong) and wrong in _WRONG and _is_count(count)


def _all(check: Check) -> Check:
    return lambda value: type(value) is list and all(map(check, value))


_COUNTS = _all(_is_count)
_OF_ALL: Mapping[str, Mapping[str, Check]] = {
    "ready": {},
    "beat": {"k": _is_count, "what": _is_text, "waits": _all(_is_text)},
    "failed": {"reason": _is_text},
    "lost": {"key": _is_key, "count": _is_count},
}
_REFUSED = {"refused": {"of": _all(_is_refusal)}}
_PROCESSES = {"agents": _COUNTS, "remembering": _COUNTS, "k": _is_count}
MAY_SAY: Mapping[str, Mapping[str, Mapping[str, Check]]] = {
    "nursery": {"ready": {}, "failed": {"reason": _is_text}},
    "agent": {**_OF_ALL, "user-code": {"reason": _is_text}, "done": {}},
    "host": {**_OF_ALL, "user-code": {"reason": _is_text}, "done": {}},
    "netem": {**_OF_ALL, **_REFUSED, "user-code": {"reason": _is_text}, "done": {}},
    "driver": {**_OF_ALL, "done": {}},
    "centre": {**_OF_ALL, **_REFUSED, "user-code": {"reason": _is_text}, "done": {}},
    "world": {
        **_OF_ALL,
        **_REFUSED,
        "tick": {"k": _is_count, "error": _is_number},
        "fired": {"triggers": _COUNTS, "k": _is_count},
        **dict.fromkeys(("kill", "restart", "pause", "resume"), _PROCESSES),
        "done": {"uninstructed": _is_count},
    },
}


def read(role: str, line: bytes) -> Event:
    """The event in a line.

    Raises
    ------
    NotItsOwn
        When it is no event that this role may tell.
    """
    may_say = MAY_SAY[role]
    try:
        said = json.loads(line)
    except (ValueError, RecursionError):
        said = None
    if type(said) is not dict or type(said.get("event")) is not str or said["event"] not in may_say:
        raise NotItsOwn(f"it said {shown(line)} on its standard output, where it may say {', '.join(may_say)}, as JSON")
    checks = may_say[said["event"]]
    facts = {name: value for name, value in said.items() if name != "event"}
    if facts.keys() != checks.keys() or not all(check(facts[name]) for name, check in checks.items()):
        needs = f"needs {', '.join(checks)}" if checks else "has nothing else in it"
        raise NotItsOwn(f"it said {shown(line)} on its standard output: {said['event']!r} {needs}")
    return said


def beat(event: Event) -> Beat:
    """What a beat says."""
    return Beat(event["k"], event["what"], tuple(event["waits"]))


def shown(line: bytes) -> str:
    """What was said, as far as it can be shown in a line."""
    text = repr(line)[1:]
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}... ({len(line):,} bytes)"


def printable(text: str) -> str:
    """A text that any terminal and file takes: control characters and lone surrogates are spelled out."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)
