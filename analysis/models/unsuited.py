"""What an algorithm raises where it does not suit what it is given."""

from __future__ import annotations


class Unsuited(ValueError):
    """The algorithm is sound, but not for this swarm: what it needs, in plain words. Then the scenario is refused."""
