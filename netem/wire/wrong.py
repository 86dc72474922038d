"""What can be wrong with a message."""

from __future__ import annotations

from enum import StrEnum


class Wrong(StrEnum):
    """By what a message is refused; the word that stands in summaries."""

    OVERSIZED = "oversized"
    FLOOD = "flood"
    MALFORMED = "malformed"
    DEEP = "nested too deep"
    SHAPE = "wrong shape"
    VALUE = "impossible value"
    SPOOFED = "in another's name"
    PAST = "of a past tick"
    FUTURE = "of a future tick"
    REPEATED = "repeated"
    SKIPPED = "out of sequence"
    MISCOUNTED = "miscounted"
    UNHEARD = "unheard"


class WireError(ValueError):
    """A message that does not say what its key promises.

    Parameters
    ----------
    says
        Who said it, what it was, and what was expected.
    wrong
        What kind of mistake that is.
    """

    def __init__(self, says: str, wrong: Wrong = Wrong.MALFORMED) -> None:
        super().__init__(says)
        self.wrong = wrong
