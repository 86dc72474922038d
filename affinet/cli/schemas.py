"""`affinet schema`: the JSON schema of scenario and study files."""

from __future__ import annotations

import argparse
import json

from affinet.reference import schema
from affinet.runtimes import directories


def print_schema(parsed: argparse.Namespace) -> None:
    """Print it, or write it down.

    Raises
    ------
    OSError
        When the file is there already, or cannot be written.
    """
    made = schema.scenario() if parsed.kind == "scenario" else schema.study()
    text = json.dumps(made, indent=1) + "\n"
    if parsed.out is None:
        print(text, end="")  # noqa: T201
    else:
        directories.new_file(parsed.out, text)
        print(f"{parsed.out}: begin a TOML file beside it with `#:schema ./{parsed.out.name}`")  # noqa: T201
