"""`affinet schema`: the JSON schema of scenario and study files."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from affinet.runtimes import directories

_KINDS = ("scenario", "study")


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Take `affinet schema` in."""
    schema = commands.add_parser(
        "schema",
        help="the JSON schema of a scenario file, or of a study, by which editors complete and check",
        description="Print a JSON schema. A TOML file whose first line is `#:schema ./affinet.schema.json` is completed and "
        "checked by editors with a TOML language server (Even Better TOML, taplo).",
    )
    schema.add_argument(
        "kind", nargs="?", choices=_KINDS, default="scenario", metavar="KIND", help="scenario (default), or study"
    )
    schema.add_argument("--out", type=Path, metavar="FILE", help="into a new file")


def print_schema(parsed: argparse.Namespace) -> None:
    """Print it, or write it down.

    Raises
    ------
    OSError
        When the file is there already, or cannot be written.
    """
    from affinet.reference import schema  # what there is of each kind takes a while to import

    made = schema.scenario() if parsed.kind == "scenario" else schema.study()
    text = json.dumps(made, indent=1) + "\n"
    if parsed.out is None:
        print(text, end="")  # noqa: T201
    else:
        directories.new_file(parsed.out, text)
        print(f"{parsed.out}: begin a TOML file beside it with `#:schema ./{parsed.out.name}`")  # noqa: T201
