"""The reference of commands: what each takes, from its parser, and its examples."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from textwrap import dedent

from marked import Lines, code, filled, table, titled

from affinet.cli import options
from affinet.cli.examples import EXAMPLES, Example
from affinet.cli.helping import shown


def page() -> Lines:
    """What each command takes, and its examples."""
    yield from titled(
        "Commands",
        "What each command takes, as `affinet COMMAND --help` says it; [when one uses which](../commands.md).",
    )
    yield from _under(options.parser(), "affinet", "##")


def _under(parser: argparse.ArgumentParser, typed: str, mark: str) -> Lines:
    """The commands of a parser, and those under them."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            says = {one.dest: one.help or "" for one in action._choices_actions}
            for name, command in action.choices.items():
                yield from ("", f"{mark} {typed} {name}", "", filled(_sentence(command.description or says[name])))
                yield from _of_command(command, EXAMPLES.get(name, ()) if mark == "##" else ())
                yield from _under(command, f"{typed} {name}", mark + "#")


def _sentence(says: str) -> str:
    words = " ".join(says.split()).rstrip(".")
    return f"{words[:1].upper()}{words[1:]}."


def _of_command(command: argparse.ArgumentParser, examples: Sequence[Example]) -> Lines:
    own = [
        one for one in command._actions[1:] if not isinstance(one, argparse._SubParsersAction)
    ]  # the first is --help
    if own:
        yield from ("", *table(("argument", "default", "what"), map(_taken, own)))
    if examples:
        yield from ("", "```text", *dedent(shown(examples)).splitlines(), "```")


def _taken(action: argparse.Action) -> Sequence[str]:
    """An argument of a command: how it is written, its default, and what it is."""
    value = action.metavar or (None if action.choices is None else "{" + ",".join(map(str, action.choices)) + "}")
    written = [*action.option_strings[-1:], *([] if action.nargs == 0 else [str(value or action.dest.upper())])]
    default = action.default
    return (
        code(" ".join(written)),
        "" if default in (None, False, [], ()) or default is argparse.SUPPRESS else code(str(default)),
        (action.help or "") % {"default": default},
    )
