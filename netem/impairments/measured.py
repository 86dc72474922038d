"""Text files of measurements as people have them: exported, commented, in the encoding of their tools."""

from __future__ import annotations

import codecs
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array

_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SHOWN = 60
LARGEST = 200_000_000  # bytes of a file
LONGEST = 86400.0  # s: a delay of more than a day is a mistake


class MeasuredError(ValueError):
    """What is wrong in a file of measurements: the line, and what would be right."""


class Lines(NamedTuple):
    """The lines of a file that say something, and their numbers in it, from 1."""

    numbers: Sequence[int]
    texts: Sequence[str]

    def after(self, first: int) -> Lines:
        """Without so many of the first."""
        return Lines(self.numbers[first:], self.texts[first:])


def read(file: Path) -> Lines:
    """The lines of a file without those that are blank or comments (#).

    Raises
    ------
    MeasuredError
        When it is no text, or has no end.
    OSError
        When it cannot be read.
    """
    every = _decoded(_content(file)).splitlines()
    numbers = [number for number, text in enumerate(every, start=1) if text.strip() and text.lstrip()[0] != "#"]
    return Lines(numbers, [every[number - 1] for number in numbers])


def delays(file: Path) -> Array:
    """Delays in seconds, one a line in any order, below a heading or without; ascending, shape (n,).

    Raises
    ------
    MeasuredError
        When a line is no such number, or there is none.
    OSError
        When it cannot be read.
    """
    lines = read(file)
    if lines.texts and lines.texts[0].strip().strip('"').isidentifier() and _number(lines.texts[0]) is None:
        lines = lines.after(1)  # the heading of a column
    values = np.array([_delay(number, text) for number, text in zip(*lines, strict=True)])
    if not len(values):
        raise MeasuredError("there is no delay in it: give one a line, in seconds")
    values.sort()
    return values


def shown(text: str) -> str:
    """A text of the file as a message can hold it."""
    return repr(text if len(text) <= _SHOWN else f"{text[:_SHOWN]}...")


def refuse_endless(file: Path) -> None:
    """Go on if it is no device and no pipe; of a directory, opening it says what it is.

    Raises
    ------
    MeasuredError
        If it is one.
    OSError
        When there is no such file.
    """
    mode = file.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise MeasuredError("no regular file but a device or a pipe, which may have no end: write it to a file first")


def _content(file: Path) -> bytes:
    refuse_endless(file)
    with file.open("rb") as opened:
        content = opened.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise MeasuredError(f"it is larger than {LARGEST / 1e6:g} MB, and no more is read: cut it into parts")
    return content


def _delay(line: int, text: str) -> float:
    seconds = _number(text)
    if seconds is None and ("time=" in text or text.startswith("PING ")):
        raise MeasuredError(
            f"line {line}: the output of ping, which says round trips in ms; "
            "give delays of one way, in seconds, one a line"
        )
    if seconds is None or not 0.0 <= seconds < np.inf:
        raise MeasuredError(f"line {line}: one delay in seconds is due, at least 0, like 0.012; got {shown(text)}")
    if seconds > LONGEST:
        raise MeasuredError(f"line {line}: {seconds:g} s are more than a day: one delay in seconds is due, like 0.012")
    return seconds


def _number(text: str) -> float | None:
    try:
        return float(text.strip().strip('"'))
    except ValueError:
        return None


def _decoded(content: bytes) -> str:
    if content.startswith(_UTF16):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")  # all that counts is ASCII, whatever the comments are written in
    if "\0" in text:
        raise MeasuredError("no text, or UTF-16 without its mark: save it as UTF-8")
    return text
