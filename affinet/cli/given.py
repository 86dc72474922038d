"""The scenario of a command line, with all that it changes of it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from affinet.scenario import files, loading
from affinet.scenario.overrides import SHORT
from affinet.scenario.sections import Scenario


def overrides(parsed: argparse.Namespace) -> list[str]:
    """What it changes."""
    given = {key: getattr(parsed, word) for word, key in SHORT.items()}
    return [*parsed.set, *(f"{key}={value}" for key, value in given.items() if value is not None)]


def scenario(parsed: argparse.Namespace, more: Sequence[str] = ()) -> Scenario:
    """The scenario, with further changes.

    Raises
    ------
    ScenarioError
        When there is none of this name, or something in it is wrong.
    """
    return loading.load(parsed.scenario, [*overrides(parsed), *more], files.working_directory())
