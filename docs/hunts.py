"""What docs/hunt.md shows of hunts: commands with what came of them, a table, and the picture of a frontier.

python docs/hunts.py fly     fly them all, in half an hour: docs/hunts.json, and the picture
python docs/hunts.py         write them into the page
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap
from typing import Any

from marked import Lines, code, table

DOCS = Path(__file__).parent
KEPT, PAGE, PICTURE = DOCS / "hunts.json", DOCS / "hunt.md", DOCS / "pictures" / "frontier.png"
ESTIMATORS = ("rkf", "conral", "ga-rkf")
BUDGET, SEEDS = 200, "1-5"
_WIDTH = 112
_TICKS = "--set time.dt=0.05"
# Verbs, and the invariant.
ROWS = (
    ("dropout", "bounded(1000)"),
    ("cut,lose,dropout,partition", "bounded(1e6)"),
    ("cut,lose,partition,delay,degrade", "bounded(20)"),
    ("freeze", "bounded(1000)"),
)
SHOWN = {
    "first": f"affinet hunt corridor --estimator rkf {_TICKS} --duration 30 --verbs dropout --invariant 'bounded(1000)'",
    "several": f"affinet hunt corridor --estimator ga-rkf {_TICKS} --duration 20 --seeds 1-20 "
    "--sweep network.availability=1,0.9,0.7 --verbs cut,lose,delay,kill,pause --invariant 'bounded(1e6)' "
    "--invariant 'recovers(0.3, within=5)' --budget 200",
    "certificate": f"affinet hunt corridor --estimator ga-rkf {_TICKS} --duration 12 --invariant 'bounded(5)' "
    "--every 'one link, up to 1 s, from any 0.5 s, with cut'",
    "none": f"affinet hunt corridor --estimator ga-rkf {_TICKS} --duration 12 --invariant 'bounded(5)' "
    "--every 'one link, up to 2 s, from any 0.5 s, with cut'",
    "frontier": f"affinet hunt corridor --estimator rkf {_TICKS} --duration 12 --invariant 'bounded(5)' "
    "--frontier frontier.png --seeds 1-20",
}


def main(given: Sequence[str]) -> None:
    """Fly, or write the page."""
    if [*given] == ["fly"]:
        kept = {"shown": {name: _shown(command) for name, command in SHOWN.items()}, "table": [*_table()]}
        KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    elif given:
        sys.exit("say fly, or nothing")
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


def page(text: str) -> str:
    """The page, with what was flown in its places."""
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    for name, block in [*((name, _session(name, kept["shown"][name])) for name in SHOWN), ("table", _rows(kept))]:
        written = f"<!-- {name}: written by docs/hunts.py -->"
        pattern = rf"{re.escape(written)}\n.*?<!-- end of {name} -->"
        new = "\n".join([written, "", *block, "", f"<!-- end of {name} -->"])
        text, places = re.subn(pattern, lambda _, new=new: new, text, flags=re.DOTALL)
        if places != 1:
            sys.exit(f"{PAGE}: {places} places for {name}")
    return text


def _session(name: str, lines: Sequence[str]) -> Lines:
    typed = SHOWN[name]
    yield from (f"    {line}".rstrip() for line in (*_wrapped(typed), *lines))


def _wrapped(command: str) -> list[str]:
    """What is typed, in lines of a page."""
    words, lines = re.findall(r"--\S+(?: (?:'[^']*'|[^-'\s]\S*))?|\S+", command), ["$"]
    for word in words:
        if len(lines[-1]) + len(word) > _WIDTH - 2:
            lines[-1] += " \\"
            lines.append("     ")
        lines[-1] += f" {word}"
    return lines


def _shown(command: str) -> list[str]:
    """What a command says, in short lines."""
    with TemporaryDirectory() as folder:
        out = _typed(command, folder).splitlines()
        if (picture := Path(folder) / "frontier.png").exists():
            shutil.copy(picture, PICTURE)
    return [part for line in out for part in wrap(line, _WIDTH, subsequent_indent="    ", break_on_hyphens=False)]


def _table() -> Iterator[dict[str, Any]]:
    for verbs, invariant in ROWS:
        for estimator in ESTIMATORS:
            command = f"affinet hunt corridor --estimator {estimator} {_TICKS} --duration 30 --seeds {SEEDS} "
            command += f"--verbs {verbs} --invariant '{invariant}' --budget {BUDGET} --json"
            with TemporaryDirectory() as folder:
                said = json.loads(_typed(command, folder).splitlines()[-1])
            yield {"verbs": verbs, "invariant": invariant, "estimator": estimator, **said}


def _typed(command: str, folder: str) -> str:
    words = [sys.executable, "-m", *shlex.split(command)]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        sys.exit(f"{command}: {done.stderr}")
    return done.stdout


def _rows(kept: dict[str, Any]) -> Lines:
    cells = {(one["verbs"], one["invariant"], one["estimator"]): _cell(one) for one in kept["table"]}
    return table(
        ("verbs, what must hold", *ESTIMATORS),
        [
            (f"{verbs.replace(',', ', ')}; {code(invariant)}", *(cells[verbs, invariant, one] for one in ESTIMATORS))
            for verbs, invariant in ROWS
        ],
    )


def _cell(one: dict[str, Any]) -> str:
    tried = one["tried"]
    if not one["found"]:
        return f"none ({tried['schedules']})"
    (found,) = one["found"]
    said = " with ".join(_said(fault) for fault in found["faults"])
    return f"{said}, seed {found['seed']} ({tried['schedules']} + {tried['shrinking']})"


def _said(fault: Sequence[dict[str, Any]]) -> str:
    first = dict(fault[0])
    verb, at, lasts = first.pop("verb"), first.pop("at"), first.pop("lasts", None)
    first.pop("in_flight", None)
    whom = first.pop("links", None) or first.pop("agents", None) or [first.pop("groups")]
    rest = "".join(
        f", {key} {value:g}" if isinstance(value, float) else f", {key} {value}" for key, value in first.items()
    )
    named = ", ".join(map(str, whom)) if len(whom) < 4 else f"on {len(whom)} links"
    return f"`{verb} {named}`{rest}: {'for good' if lasts is None else f'{lasts:g} s'} from {at:g} s"


if __name__ == "__main__":
    main(sys.argv[1:])
