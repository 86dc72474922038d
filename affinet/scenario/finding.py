"""What was found of a scenario before it flies, in plain words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "note", "error"]


@dataclass(frozen=True)
class Finding:
    """The outcome of one check."""

    check: str
    level: Level
    says: str

    @property
    def fatal(self) -> bool:
        """Whether the scenario cannot fly."""
        return self.level == "error"
