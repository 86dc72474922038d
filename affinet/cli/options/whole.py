"""All commands together."""

from __future__ import annotations

import argparse
from typing import Any

from affinet.cli import helping
from affinet.cli.options import beginning, flown, machines, many, scenarios, traces
from affinet.cli.options.parser import Parser


def parser() -> Parser:
    """Reads a command line; `command` is the word of the command."""
    whole = Parser(prog="affinet", description=helping.PURPOSE, epilog=helping.MORE)
    whole.add_argument("--version", action=_Version, nargs=0, help="show the version, and exit")
    commands = whole.add_subparsers(dest="command", metavar="COMMAND")
    for module in (scenarios, flown, many, traces, machines, beginning):
        module.add(commands)
    helping.end_with_examples(whole)
    return whole


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version  # it reads what is installed

        print(f"affinet {version('affinet')}")  # noqa: T201
        parser.exit()
