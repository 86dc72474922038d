"""Words for people: the nearest of those there are, values as a file says them, text that stays on one line."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping
from itertools import islice

_MOST_ITEMS, _DEEPEST = 6, 4
_ENDLESS = re.compile(r"\S{400,}")  # longer than a path that somebody wrote


def hint(word: object, known: Iterable[str]) -> str:
    """The question whether the nearest of the known words is meant, with a space behind it; nothing if none is near."""
    plain = {_plain(name): name for name in known}
    close = difflib.get_close_matches(_plain(str(word)), plain, n=1)
    return f"did you mean {plain[close[0]]!r}? " if close else ""


def among(word: object, known: Iterable[str]) -> str:
    """All the known words, behind the question whether the nearest is meant."""
    names = list(known)
    return f"{hint(word, names)}there are {', '.join(names)}"


def shown(value: object, most: int = 60) -> str:
    """A value as a TOML file says it, cut to a length that people read."""
    text = _toml(value, _DEEPEST)
    return text if len(text) <= most else f"{text[: most - 3]}..."


def one_line(text: str) -> str:
    """The text on one line, whatever names hold: what breaks lines or cannot be printed is escaped, what has no end cut."""
    return _ENDLESS.sub(_cut, "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in text))


def _cut(word: re.Match[str]) -> str:
    return f"{word[0][:200]}...{word[0][-20:]}"


def _plain(word: str) -> str:
    return word.strip().lower().replace("_", "-").replace(" ", "-")


def _toml(value: object, depth: int) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return one_line(json.dumps(value[:200], ensure_ascii=False))
        case int() if value.bit_length() > 256:
            return f"a number of {value.bit_length()} bits"  # Python refuses to write very long ones
        case list() | tuple():
            return f"[{_items((_toml(item, depth - 1) for item in value), len(value)) if depth else '...'}]"
        case Mapping():
            said = (f"{name} = {_toml(item, depth - 1)}" for name, item in value.items())
            return one_line(f"{{ {_items(said, len(value)) if depth else '...'} }}") if value else "{}"
    return one_line(str(value))


def _items(said: Iterable[str], number: int) -> str:
    return ", ".join([*islice(said, _MOST_ITEMS), *(["..."] if number > _MOST_ITEMS else [])])
