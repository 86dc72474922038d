"""Names in a sentence: the first of them, and how many more there are."""

from __future__ import annotations

from collections.abc import Iterable


def listed(names: Iterable[object], most: int = 6, between: str = ", ") -> str:
    """The first of them with something between, and how many more there are: `1, 2 and 5 more`.

    Parameters
    ----------
    names
        What is said of as text.
    most
        How many are named.
    between
        What stands between two.
    """
    all_names = [*map(str, names)]
    named = between.join(all_names[:most])
    return f"{named} and {len(all_names) - most} more" if len(all_names) > most else named
