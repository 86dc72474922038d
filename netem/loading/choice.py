"""What of a user's own is to run, as it travels: where its class is, and with which parameters it is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from netem.loading import parameters
from netem.loading.calling import Calling, load


@dataclass(frozen=True)
class Choice:
    """A class to make something of.

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
        """What is made of it.

        Raises
        ------
        UserCodeError
            When its module cannot be imported, or it cannot be made.
        """
        kind = load(self.path, self.folder)
        with Calling(kind, "__init__"):
            made = kind(**parameters.arguments(kind, self.parameters))
        with Calling(kind, "__getattribute__"):
            made.__class__  # noqa: B018 - whoever asks what it is asks this, and it may refuse to tell
        return made
