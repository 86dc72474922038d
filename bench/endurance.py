"""What a long run takes: the memory of each of its processes and the sizes of its files, over its ticks.

    python bench/endurance.py inprocess [--ticks 1000000] [--keep docs/endurance.json]

Flies `endurance.toml`, with a fault each second, looks at it from outside, and fails when the memory of a process has grown by
5 % or more since the first 10,000 ticks. Over processes an agent is killed every four seconds, and comes back as a new process.
`--keep` puts what was measured in place of what was measured of this runtime before.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from world.books import growing
from world.books.history import ARRAYS, file_of

SCENARIO = Path(__file__).with_name("endurance.toml")
SETTLED, MOST = 10_000, 0.05  # ticks after which no memory may grow, by no more than this share
_EVERY_S = 1.0


@dataclass(frozen=True)
class Look:
    """A run at a moment.

    Parameters
    ----------
    tick
        How many ticks are written down.
    seconds
        Since the start.
    memory
        Of each process by name, what is resident, in bytes.
    files
        Of each of the arrays, the journal, the graph and the recording, in bytes.
    """

    tick: int
    seconds: float
    memory: dict[str, int]
    files: dict[str, int]


def looks(process: psutil.Process, out: Path) -> Iterator[Look]:
    """A run, looked at until it has ended."""
    began = time.monotonic()
    while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
        yield Look(_ticks(out), round(time.monotonic() - began, 1), _memory(process), _files(out))
        with suppress(psutil.TimeoutExpired):
            process.wait(_EVERY_S)


def _ticks(out: Path) -> int:
    with suppress(OSError, ValueError):
        return len(growing.read(out / ARRAYS / file_of("copies")))
    return 0


def _memory(process: psutil.Process) -> dict[str, int]:
    found: dict[str, int] = {}
    with suppress(psutil.Error):
        for one in [process, *process.children(recursive=True)]:
            with suppress(psutil.Error):
                name = "launcher" if one == process else one.name()
                found[name] = one.memory_info().rss
    return found


def _files(out: Path) -> dict[str, int]:
    kinds = {"arrays": f"{ARRAYS}/*", "journal": "journal*.arrows", "graph": "graph*.arrows", "recording": "run*.rrd"}
    return {kind: sum(file.stat().st_size for file in out.glob(pattern)) for kind, pattern in kinds.items()}


def grown(seen: list[Look]) -> dict[str, float]:
    """By which share the memory of each process has grown at most since it had settled, while it flew."""
    first: dict[str, int] = {}
    most: dict[str, float] = {}
    for look in _flying(seen):
        for name, size in look.memory.items():
            share = size / first.setdefault(name, size) - 1.0
            most[name] = max(most.get(name, 0.0), share)
    return most


def judging(seen: list[Look]) -> int:
    """How much more memory the launcher takes at the end, when it judges, in bytes."""
    flying = _flying(seen) or seen[:1]
    return max(look.memory.get("launcher", 0) for look in seen) - max(look.memory["launcher"] for look in flying)


def _flying(seen: list[Look]) -> list[Look]:
    return [look for look in seen if SETTLED <= look.tick < seen[-1].tick]


def thinned(seen: list[Look], number: int = 400) -> list[Look]:
    """Some of the looks, from the first to the last."""
    step = max(1, len(seen) // number)
    return [*seen[::step], *seen[-1:]]


def scenario(ticks: int, *, killing: bool) -> str:
    """The scenario of so many ticks; processes of agents are killed in place of the gusts, and started again."""
    text = SCENARIO.read_text()
    seconds = ticks * tomllib.loads(text)["time"]["dt"]
    text = text.replace("duration = 10_000.0", f"duration = {seconds:.6f}")
    if not killing:
        return text
    quiet, _ = text.split("# gusts")
    return quiet + "".join(
        f'[[timeline]]\nverb = "{verb}"\nat = {at + after}\nagents = [6]\n'
        for at in np.arange(3.5, seconds - 1.0, 4.0)
        for verb, after in (("kill", 0.0), ("restart", 0.5))
    )


def fly(runtime: str, ticks: int, folder: Path) -> dict[str, Any]:
    """Fly, and what was seen of it."""
    file, out = folder / "endurance.toml", folder / "run"
    file.write_text(scenario(ticks, killing=runtime == "processes"))
    command = [sys.executable, "-m", "affinet", "run", str(file), "--json", "--out", str(out), "--runtime", runtime]
    with (folder / "said").open("w") as said:
        launched = psutil.Popen(command, stdout=said)
        seen = list(looks(launched, out))
        status = launched.wait()
    summary = json.loads((folder / "said").read_text().splitlines()[-1])
    return {
        "machine": f"{psutil.cpu_count()} cores, Python {platform.python_version()}",
        "status": status,
        **{name: summary[name] for name in ("verdict", "reasons", "digest", "ticks", "wall_s")},
        "faults": len(summary["faults"]),
        "processes": len(summary["processes"]),
        "grown": grown(seen),
        "judging": judging(seen),
        "looks": [asdict(look) for look in thinned(seen)],
    }


def main() -> int:
    """Fly, print the table, and keep the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runtime", choices=("inprocess", "processes"))
    parser.add_argument("--ticks", type=int, default=1_000_000)
    parser.add_argument("--keep", type=Path, metavar="FILE")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="endurance-") as folder:
        found = fly(options.runtime, options.ticks, Path(folder))
    said = (found["verdict"], *found["reasons"])
    print(f"{'; '.join(said)}: {found['ticks']} ticks, {found['faults']} faults, {found['wall_s']:.0f} s")
    print(f"\n| process | MB after {SETTLED} ticks | MB at its end | grown by at most |\n|---|---|---|---|")
    settled = next((look for look in found["looks"] if look["tick"] >= SETTLED), found["looks"][-1])
    for name, share in found["grown"].items():
        last = next(look["memory"][name] for look in reversed(found["looks"]) if name in look["memory"])
        print(f"| {name} | {settled['memory'].get(name, 0) / 1e6:.1f} | {last / 1e6:.1f} | {share:.1%} |")
    print(f"\nTo judge, the launcher takes {found['judging'] / 1e6:.1f} MB more.")
    if options.keep:
        kept = json.loads(options.keep.read_text()) if options.keep.exists() else {}
        options.keep.write_text(json.dumps(kept | {options.runtime: found}) + "\n")
    return int(found["status"] or any(share >= MOST for share in found["grown"].values()))


if __name__ == "__main__":
    sys.exit(main())
