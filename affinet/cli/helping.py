"""What help says beside the options: the examples of each command, and what one does next."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Mapping, Sequence

from affinet.cli.examples import EXAMPLES, NEXT, Example

PURPOSE = "Fly a swarm of agents through a network that loses, delays and cuts."
MORE = "`affinet COMMAND --help` says more of a command, with examples."
_WIDTH = 100
_BESIDE = 50  # characters of a line, behind which there is room


def commands_of(whole: argparse.ArgumentParser) -> Mapping[str, argparse.ArgumentParser]:
    """The parser of each command, by its word."""
    (commands,) = (action for action in whole._actions if isinstance(action, argparse._SubParsersAction))
    return dict(commands.choices)


def guide(whole: argparse.ArgumentParser) -> str:
    """What one does next, for who has typed no command."""
    there = commands_of(whole)
    steps = [step for step in NEXT if step.line.split()[1] in there]
    return f"{PURPOSE}\n\nWhat one does next:\n\n{shown(steps)}\n\n`affinet --help` lists all commands. {MORE}"


def end_with_examples(whole: argparse.ArgumentParser) -> None:
    """End the help of each command with its examples."""
    for name, command in commands_of(whole).items():
        command.formatter_class = argparse.RawDescriptionHelpFormatter
        command.description = command.description and textwrap.fill(command.description, _WIDTH)
        command.epilog = f"examples:\n{shown(EXAMPLES[name])}"


def shown(examples: Sequence[Example]) -> str:
    """A line each; what it is for stands above it where both do not fit beside each other."""
    width = max(len(example.line) for example in examples)
    if width <= _BESIDE:
        return "\n".join(f"  {example.line:{width}}  # {example.says}" for example in examples)
    return "\n".join(f"  # {example.says}\n  {example.line}" for example in examples)
