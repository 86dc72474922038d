"""What earlier runs found, in `bench/history.json`: an entry for each run that was kept, with its machine and versions."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import date
from importlib import metadata
from pathlib import Path
from typing import Any

from speed.measured import Measured

FILE = Path(__file__).parents[1] / "history.json"
_PACKAGES = ("numpy", "numba", "eclipse-zenoh", "filterpy", "pyzmq", "ray")


@dataclass(frozen=True)
class Entry:
    """A run that was kept.

    Parameters
    ----------
    day
        When it was, as ISO 8601 has it.
    machine
        CPU and cores: ratios of machines of one kind are compared.
    load
        Processes that wanted a core in the minute before the first and after the last round.
    share
        Of the ticks that are usual: ratios of few and of many ticks are not compared.
    versions
        By package.
    ratios, exponents
        By name.
    """

    day: str
    machine: str
    load: tuple[float, float]
    share: float
    versions: Mapping[str, str]
    ratios: Mapping[str, Measured]
    exponents: Mapping[str, Measured]


def machine() -> str:
    """What this one is."""
    cpu = platform.processor() or platform.machine()
    if os.path.exists("/proc/cpuinfo"):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        cpu = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), cpu)
    return f"{cpu}, {len(os.sched_getaffinity(0))} cores, {platform.system()}"


def versions() -> dict[str, str]:
    """Those that count, as far as they are installed."""
    found = {"python": platform.python_version(), "affinet": metadata.version("affinet")}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def today() -> str:
    """The day."""
    return date.today().isoformat()


def read(file: Path) -> list[Entry]:
    """All entries, the oldest first; none where there is no file.

    Raises
    ------
    ValueError
        When it is no history.
    """
    if not file.exists():
        return []
    try:
        return [_entry(**fields) for fields in json.loads(file.read_text())]
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{file} is no history of bench/all.py ({error}): take it back from git, or delete it"
        ) from None


def _entry(
    ratios: Mapping[str, list[Any]], exponents: Mapping[str, list[Any]], load: list[float], **others: Any
) -> Entry:
    measured = [{name: Measured(*values) for name, values in each.items()} for each in (ratios, exponents)]
    return Entry(load=(load[0], load[1]), ratios=measured[0], exponents=measured[1], **others)


def keep(file: Path, entry: Entry) -> None:
    """Add an entry."""
    entries = [asdict(one) for one in (*read(file), entry)]
    file.write_text(json.dumps(entries, indent=1) + "\n")


def last(entries: Iterable[Entry], now: Entry) -> dict[str, Measured]:
    """Each ratio as the last entry that has it found it, of those of the same kind of machine and share of ticks."""
    found: dict[str, Measured] = {}
    for entry in entries:
        if (entry.machine, entry.share) == (now.machine, now.share):
            found |= entry.ratios
    return found
