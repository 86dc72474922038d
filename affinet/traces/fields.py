"""Fields of a line as numbers and names, with the line where they are none."""

from __future__ import annotations

import math

from netem.impairments.measured import MeasuredError, shown

LATEST = 1e11  # s: in milliseconds, times of this century are more
FARTHEST = 1e9  # m, and m/s
FASTEST = 1e15  # bit/s
LARGEST_DB = 1000.0  # of a signal or a pathloss, either way
MOST_NODES = 1000  # of files that tell of all pairs
_WHOLE = 1e15  # below, all whole numbers are floats


def number(line: int, text: str, what: str, *, least: float = -FARTHEST, most: float = FARTHEST) -> float:
    """A finite number.

    Parameters
    ----------
    line, text
        Where it stands, and how.
    what
        What it says, with its unit, for people.
    least, most
        Between what it lies.

    Raises
    ------
    MeasuredError
        When it is none, too small, or too large.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isfinite(value) and value > most:
        raise MeasuredError(f"line {line}: {what} is due, at most {most:g}; got {shown(text)}: is its unit another?")
    if not (math.isfinite(value) and value >= least):
        bound = f", at least {least:g}" if least > -FARTHEST or math.isfinite(value) else ""
        raise MeasuredError(f"line {line}: a number is due for {what}{bound}; got {shown(text)}")
    return value


def moment(line: int, text: str, what: str = "a time in s", *, least: float = 0.0) -> float:
    """A time, in seconds from when a log began, or of a clock on the wall.

    Parameters
    ----------
    line, text, what, least
        As of `number`.

    Raises
    ------
    MeasuredError
        When it is none.
    """
    return number(line, text, what, least=least, most=LATEST)


def node(text: str) -> str:
    """What a node is called; one that is a number is so however it is written, as 3, 3.0 or 03."""
    text = text.strip()
    try:
        value = float(text)
    except ValueError:
        return text
    return str(int(value)) if value % 1.0 == 0.0 and abs(value) < _WHOLE else f"{value:g}"


def numbers_only(text: str) -> list[float] | None:
    """The numbers of a line, by blanks or commas, None where it has something else."""
    try:
        return [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return None
