"""`affinet doctor`: whether all is there that affinet needs."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from affinet.cli import show


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Take `affinet doctor` in."""
    doctor = commands.add_parser(
        "doctor",
        help="whether all is there that affinet needs, and the way out where it is not",
        description="Look at versions, sockets, descriptors, cores, memory and display, and fly a short run twice. Exit status "
        "1 where something is missing that is needed.",
    )
    doctor.add_argument("--json", action="store_true", help="print one JSON object")


def examine(parsed: argparse.Namespace) -> bool:
    """Say what was found; whether nothing is missing that is needed."""
    from affinet.runtimes import health

    found = list(health.findings())
    healthy = not any(finding.fatal for finding in found)
    if parsed.json:
        print(json.dumps({"healthy": healthy, "findings": [asdict(finding) for finding in found]}))  # noqa: T201
    else:
        show.findings("affinet can fly here" if healthy else "something is missing", found)
    return healthy
