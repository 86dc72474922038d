"""Programs of a user's own that fly agents: their command lines, and whose they are."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping

_NUMBER = re.compile(r"0|[1-9][0-9]{0,8}")


def words(command: str) -> list[str]:
    """The words of a command line, as a shell reads them.

    Raises
    ------
    ValueError
        When there are none, or a quote does not end.
    """
    try:
        read = shlex.split(command)
    except ValueError as error:
        raise ValueError(f"{command!r} is no command line: {str(error).lower()}") from error
    if not read:
        raise ValueError('an empty command line starts nothing: say what does, like "python my_agent.py"')
    return read


def of_agents(programs: Mapping[str, str]) -> dict[str, str]:
    """The same, each of an agent, and each a command line.

    Raises
    ------
    ValueError
        When one is not.
    """
    for number, command in programs.items():
        if not _NUMBER.fullmatch(number):
            raise ValueError(f'{number!r} is no agent: give its number, like "3" = "python my_agent.py"')
        words(command)
    return dict(programs)
