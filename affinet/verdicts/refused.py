"""What was refused of what came over the network, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Refused = Sequence[Mapping[str, Any]]


def by_sender(refused: Refused) -> dict[str, str]:
    """Of each agent whose messages were refused, how many, for what, and by whom.

    Parameters
    ----------
    refused
        As in `outcome.Outcome`.
    """
    said: dict[str, list[str]] = {}
    for one in refused:
        who = "the control login" if one["agent"] is None else f"agent {one['agent']}"
        said.setdefault(who, []).append(f"{one['count']} {one['wrong']} ({one['by']})")
    return {who: ", ".join(what) for who, what in said.items()}


def in_words(refused: Refused) -> str:
    """All of it in a line."""
    return "; ".join(f"refused of {who}: {what}" for who, what in by_sender(refused).items())
