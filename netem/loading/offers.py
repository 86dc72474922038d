"""What installed packages offer, by name; none of it is imported."""

from __future__ import annotations

from importlib.metadata import entry_points


def offered(group: str) -> dict[str, str]:
    """What installed packages offer in a group of entry points: "module:Class" by name."""
    return {point.name: f"{point.module}:{point.attr}" for point in entry_points(group=group)}
