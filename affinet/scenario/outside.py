"""Sections of a world that is not simulated: a flight that was recorded, or robots outside."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator

from affinet.scenario.keys import key
from affinet.scenario.programs import words
from affinet.scenario.section import Section


def _command(line: str) -> str:
    words(line)
    return line


class RecordedSection(Section):
    """A flight that stands in for bodies and sensors: a CSV file, or the directory of a run."""

    flight: str = key(..., "a CSV file, or the directory of a run")


class ExternalSection(Section):
    """The command line of the driver, which says what is measured on the robots and has them fly what agents command."""

    driver: Annotated[str, AfterValidator(_command)] = key(
        ...,
        "command line of the driver that says what is measured on the robots, and has them fly what agents "
        "command; it starts in the working directory of `affinet`",
    )
