"""An algorithm that was chosen, and its parameters: what a process is told of it, and how it is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from agents.loading import parameters
from agents.loading.calling import Calling, load


@dataclass(frozen=True)
class Choice:
    """An algorithm to run.

    Parameters
    ----------
    path
        "module:Class".
    parameters
        Those of its parameters that were given, as a scenario says them.
    folder
        In which its module lies, if that is the user's own.
    """

    path: str
    parameters: dict[str, Any]
    folder: str | None = None

    def build(self) -> Any:
        """The algorithm.

        Raises
        ------
        UserCodeError
            When its module cannot be imported, or the algorithm not be made.
        """
        algorithm = load(self.path, self.folder)
        with Calling(algorithm, "__init__"):
            made = algorithm(**parameters.arguments(algorithm, self.parameters))
        with Calling(algorithm, "__getattribute__"):
            _ = made.__class__  # which it may refuse to tell
        return made
