"""Where a scenario came from, and where in it a key was given."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

_DOT = re.compile(r"""\.(?=(?:[^"']|"[^"]*"|'[^']*')*$)""")  # not inside quotes


@dataclass(frozen=True)
class Source:
    """Where a scenario came from: the file, its text, and the keys that were overridden."""

    file: str
    text: str
    overridden: tuple[str, ...]

    def place(self, key: str) -> str:
        """Where a key was given: an override, or the file with the line of the key."""
        if self.overrides_say(key):
            return "override"
        steps = [int(step) - 1 if step.isdecimal() else step for step in key.split(".")]
        line = _line_of(self.text, steps)
        return f"{self.file}:{line}" if line else self.file

    def overrides_say(self, key: str) -> bool:
        """Whether a key was given by an override, or a part of it, or a table that it is part of."""
        given = self.overridden
        return any(one == key or one.startswith(f"{key}.") or key.startswith(f"{one}.") for one in given)


IN_CODE = Source("in code", "", ())  # what no file says


def parts(key: str) -> list[str]:
    """The parts of a key as TOML writes it: a part in quotes may have dots in it."""
    return [_unquoted(part.strip()) for part in _DOT.split(key)]


def _unquoted(part: str) -> str:
    return part[1:-1] if len(part) > 1 and part[0] == part[-1] and part[0] in "\"'" else part


def _header(line: str) -> str:
    return line.strip().replace('"', "").replace("'", "")


def _line_of(text: str, steps: Sequence[str | int]) -> int | None:
    """The line of a key in the file: a look for its table's header, then for the key below it."""
    names = [str(step) for step in steps if isinstance(step, str)]
    number = next((step for step in steps if isinstance(step, int)), 0)
    lines = text.splitlines()
    for depth in range(len(names), -1, -1):
        header = ".".join(names[:depth])
        heads = [n for n, line in enumerate(lines) if header and _header(line) in (f"[{header}]", f"[[{header}]]")]
        start = heads[min(number, len(heads) - 1)] if heads else (-1 if not header else None)
        if start is None:
            continue
        for n in range(start + 1, len(lines)):
            if lines[n].startswith("["):
                break
            if depth < len(names) and re.match(rf"\s*{re.escape(names[depth])}\s*=", lines[n]):
                return n + 1
        return start + 1 if start >= 0 else None
    return None
