"""Fields of a line as numbers, with the line where they are none."""

from __future__ import annotations

import math

from netem.impairments.measured import MeasuredError, shown


def number(line: int, text: str, what: str, *, least: float = -math.inf) -> float:
    """A finite number.

    Parameters
    ----------
    line, text
        Where it stands, and how.
    what
        What it says, with its unit, for people.
    least
        What it is at least.

    Raises
    ------
    MeasuredError
        When it is none, or too small.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= least):
        bound = f", at least {least:g}" if least > -math.inf else ""
        raise MeasuredError(f"line {line}: a number is due for {what}{bound}; got {shown(text)}")
    return value


def numbers_only(text: str) -> list[float] | None:
    """The numbers of a line, by blanks or commas, None where it has something else."""
    try:
        return [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return None
