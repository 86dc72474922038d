"""Commands by which one begins: what there is, something small that works, and whether all is there."""

from __future__ import annotations

import argparse
from pathlib import Path

LISTED = (
    "scenarios",
    "estimators",
    "laws",
    "profiles",
    "impairments",
    "verbs",
    "checkers",
    "studies",
    "figures",
    "cards",
)
BEGUN = ("scenario", "estimator", "law", "study", "test", "project")
SCHEMAS = ("scenario", "study")
SHELLS = ("bash", "zsh", "fish")


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add them."""
    _add_list(commands)
    _add_schema(commands)
    _add_new(commands)
    _add_doctor(commands)
    _add_completion(commands)


def _add_list(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    listing = commands.add_parser(
        "list",
        help="what there is: scenarios, estimators, verbs, ..., with parameters, units and defaults",
        description="List what there is of a kind, that of installed packages included.",
    )
    listing.add_argument("kind", nargs="?", choices=LISTED, metavar="KIND", help=f"one of: {', '.join(LISTED)}")
    listing.add_argument(
        "name", nargs="?", metavar="NAME", help="this one; of estimators, laws and impairments also module:Class"
    )
    listing.add_argument("--json", action="store_true", help="print one JSON object")


def _add_schema(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    schema = commands.add_parser(
        "schema",
        help="the JSON schema of a scenario file, or of a study, by which editors complete and check",
        description="Print a JSON schema. A TOML file whose first line is `#:schema ./affinet.schema.json` is completed and "
        "checked by editors with a TOML language server (Even Better TOML, taplo).",
    )
    schema.add_argument(
        "kind", nargs="?", choices=SCHEMAS, default="scenario", metavar="KIND", help="scenario (default), or study"
    )
    schema.add_argument("--out", type=Path, metavar="FILE", help="into a new file")


def _add_new(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    new = commands.add_parser(
        "new",
        help="write a scenario, an estimator, a law, a study, a test or a project to begin with",
        description="Write a small, commented thing that works at once, into the working directory. Nothing is overwritten.",
    )
    new.add_argument("kind", choices=BEGUN, metavar="KIND", help=f"one of: {', '.join(BEGUN)}")
    new.add_argument("name", metavar="NAME", help="small letters, figures and dashes, like my-filter")


def _add_doctor(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    doctor = commands.add_parser(
        "doctor",
        help="whether all is there that affinet needs, and the way out where it is not",
        description="Look at versions, sockets, descriptors, cores, memory and display, and fly a short run twice. Exit status "
        "1 where something is missing that is needed.",
    )
    doctor.add_argument("--json", action="store_true", help="print one JSON object")


def _add_completion(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    completion = commands.add_parser(
        "completion",
        help="print what completes the command line in a shell",
        description="Print a script that completes commands, options, names of scenarios, estimators and studies, and run "
        "directories. Print it again when a package is installed that brings names of its own.",
    )
    completion.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of: {', '.join(SHELLS)}")
