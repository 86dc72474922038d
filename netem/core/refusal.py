"""What all errors have in common by which affinet refuses what it was asked for."""

from __future__ import annotations


class Refusal(Exception):
    """What was asked for cannot be had: why, and the way out, in one line; a command ends by saying it."""
