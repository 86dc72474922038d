"""What is wrong in a scenario, and the key that is to blame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from netem.core.refusal import Refusal


class ScenarioError(Refusal, ValueError):
    """What is wrong in a scenario, in one line: file, key, and what would be right."""


@contextmanager
def said_at(key: str) -> Iterator[None]:
    """What is wrong in the block is said as a problem of this key."""
    try:
        yield
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(f"{key}: {error}") from error
