"""What coverage.py says of a run of the tests, by room: docs/coverage.md.

python docs/covered.py COVERAGE.json
"""

from __future__ import annotations

import json
import platform
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parent / "coverage.md"


def page(report: Mapping[str, Any]) -> str:
    """The page on a report of `coverage json`.

    Parameters
    ----------
    report
        As it is read.
    """
    statements, covered = Counter[str](), Counter[str]()
    for file, found in report["files"].items():
        room = "/".join(Path(file).parts[:2])
        for name in (room, "all"):
            statements[name] += found["summary"]["num_statements"]
            covered[name] += found["summary"]["covered_lines"]
    rows = [(name, statements[name], covered[name]) for name in ("all", *sorted(statements.keys() - {"all"}))]
    return "\n".join(
        [
            "# Coverage",
            "",
            f"`make coverage` wrote this on {report['meta']['timestamp'][:10]}, with Python {platform.python_version()}.",
            "Tests that fly over processes are left out: of what starts them (`affinet/runtimes`), of `process.py`,",
            "`carrier.py` and `netem/wire` the tests run more than it says.",
            "",
            "| room | statements | run |",
            "|---|---|---|",
            *(f"| {name} | {of} | {100 * ran / of:.1f} % |" for name, of, ran in rows if of),
            "",
        ]
    )


if __name__ == "__main__":
    PAGE.write_text(page(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))), encoding="utf-8")
