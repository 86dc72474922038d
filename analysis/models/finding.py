"""What was found of a scenario before it flies, in plain words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "note", "error"]


@dataclass(frozen=True)
class Finding:
    """The outcome of one check.

    Parameters
    ----------
    check
        What was checked, in a word or two.
    level
        "ok"; "note", for what to know of; or "error": then the scenario does not fly.
    says
        What was found, and the way out.
    """

    check: str
    level: Level
    says: str

    @property
    def fatal(self) -> bool:
        """Whether the scenario cannot fly."""
        return self.level == "error"
