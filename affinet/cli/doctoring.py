"""`affinet doctor`: whether all is there that affinet needs."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from affinet.cli import show
from affinet.cli.status import FAIL, PASS
from affinet.runtimes import health


def examine(parsed: argparse.Namespace) -> int:
    """Say what was found, which fails where something is missing that is needed."""
    found = list(health.findings())
    healthy = not any(finding.fatal for finding in found)
    if parsed.json:
        print(json.dumps({"healthy": healthy, "findings": [asdict(finding) for finding in found]}))  # noqa: T201
    else:
        show.findings("affinet can fly here" if healthy else "something is missing", found)
    return PASS if healthy else FAIL
