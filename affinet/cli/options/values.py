"""What is typed behind options: read, or refused in a line that says what would be right."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from affinet.scenario import programs
from affinet.scenario.bounds import LARGEST, LATEST, MOST, SMALLEST

DRAWN = (".png", ".pdf", ".svg")


def count(text: str) -> int:
    """A whole number above 0."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number, at least 1")
    return int(text)


def up_to(most: int) -> Callable[[str], int]:
    """What reads a whole number above 0, and not above this."""

    def read(text: str) -> int:
        if (number := count(text)) > most:
            raise argparse.ArgumentTypeError(f"{text}: give at most {most}")
        return number

    return read


def between(low: float, high: float) -> Callable[[str], float]:
    """What reads a number within these bounds."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: give a number from {low:g} to {high:g}")
        return value

    return read


positive = between(SMALLEST, LARGEST)
moment = between(SMALLEST, LATEST)


def seed(text: str) -> int:
    """A seed."""
    if not text.isdecimal() or int(text) >= 2**64:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number below 2^64")
    return int(text)


def seeds(text: str) -> range:
    """Seeds from one to another."""
    first, dash, last = text.partition("-")
    ends = (first, last if dash else first)
    if not all(end.isascii() and end.isdecimal() for end in ends):
        raise argparse.ArgumentTypeError(f"{text!r}: write seeds as 1-50, or one as 7")
    low, high = map(int, ends)
    if high < low or high - low >= MOST or high >= 2**64:
        raise argparse.ArgumentTypeError(f"{text!r}: give the smaller seed first, and seeds below 2^64")
    return range(low, high + 1)


def path(text: str) -> Path:
    """A path."""
    if not text:
        raise argparse.ArgumentTypeError("it is empty: name a directory")
    return Path(text)


def scenario_file(text: str) -> Path:
    """The path of a scenario that is to be written."""
    if not text.endswith(".toml"):
        raise argparse.ArgumentTypeError(f"a scenario is a TOML file: call it {text}.toml")
    return Path(text)


def drawing(text: str) -> Path:
    """The path of a picture that is to be drawn."""
    if not text.endswith(DRAWN):
        raise argparse.ArgumentTypeError(f"{text!r}: give a name that ends in {', '.join(DRAWN)}")
    return Path(text)


def groups(text: str) -> tuple[tuple[int, ...], ...]:
    """Groups of agents."""
    try:
        return tuple(tuple(int(agent) for agent in group.split(",")) for group in text.split("/"))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: write groups of agents as 1,2,3/4,5,6,7") from error


def command_line(text: str) -> list[str]:
    """The words of a program and what it is told."""
    try:
        return programs.words(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
