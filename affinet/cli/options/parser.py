"""A parser whose complaints are what all others are: one line, with what was meant, and what would be right."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from affinet.scenario.words import among, hint, one_line

_BAD_INPUT = 2


class Parser(argparse.ArgumentParser):
    """Reads what is typed behind a command."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in a line, and exit."""
        says = message.removeprefix("argument ")
        more = f"; `{self.prog} --help` says what it takes" if says.startswith("the following arguments") else ""
        print(one_line(f"{self.prog}: {says}{more}"), file=sys.stderr)  # noqa: T201
        sys.exit(_BAD_INPUT)

    def read(self, arguments: Sequence[str] | None) -> argparse.Namespace:
        """What a command line says, of which nothing may be left; by default that of this process."""
        parsed, strange = self.parse_known_args(arguments)
        if strange:
            self._of(parsed)._refuse(strange[0])
        return parsed

    def _of(self, parsed: argparse.Namespace) -> Parser:
        """The parser of the command that was typed."""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction) and (word := getattr(parsed, action.dest)) is not None:
                within: Parser = action.choices[word]
                return within._of(parsed)
        return self

    def _refuse(self, strange: str) -> NoReturn:
        near = hint(strange.partition("=")[0], self._option_string_actions)
        self.error(f"{strange}: not known here; {near or f'`{self.prog} --help` says what is'}".rstrip())

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            raise argparse.ArgumentError(action, f"{value!r}: {among(value, map(str, action.choices))}")
