"""`affinet completion`: what completes the command line in bash, zsh and fish, made of the parser and of what there is."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import shtab

from affinet.cli import options
from affinet.cli.helping import commands_of
from affinet.scenario import files
from netem.loading.offers import offered

# Where the script goes, in place of what shtab says of it: as docs/commands.md and the help do.
_USAGE = re.compile(r"^# Usage:\n(?:#.*\n)+", re.MULTILINE)
_PLACE = {
    "bash": "affinet completion bash > ~/.local/share/bash-completion/completions/affinet",
    "zsh": 'affinet completion zsh > "${fpath[1]}/_affinet"',
    "fish": "affinet completion fish > ~/.config/fish/completions/affinet.fish",
}
Completed = Mapping[str, Any]  # as shtab has it: a function by shell, and what defines it under "preamble"


def write(parsed: argparse.Namespace) -> None:
    """Print it."""
    print(script(parsed.shell, options.parser()), end="")  # noqa: T201


def script(shell: str, whole: argparse.ArgumentParser) -> str:
    """What completes the command line that this parser reads."""
    known = {name: made() for name, made in _KNOWN.items()}
    for parser in commands_of(whole).values():
        for action in parser._actions:
            if action.choices is None and action.dest in known:
                vars(action)["complete"] = known[action.dest]
    return _USAGE.sub(f"# {_PLACE[shell]}\n", shtab.complete(whole, shell), count=1)


def _estimators() -> Completed:
    return _named("estimators", sorted(offered("affinet.estimators")), "")


def _named(kind: str, names: Sequence[str], ending: str) -> Completed:
    """Names, and files that end so, if any do."""
    function, words = f"_affinet_{kind}", " ".join(names)
    of_bash = f'; compgen -f -X "!*{ending}" -- "$1"; compgen -d -- "$1"' if ending else ""
    of_zsh = f" 'files:file:_files -g \"*{ending}\"'" if ending else ""
    of_fish = f"; __fish_complete_suffix {ending}" if ending else ""
    return _function(
        function,
        bash=f'{function}() {{ compgen -W "{words}" -- "$1"{of_bash}; }}',
        zsh=f"{function}() {{ _alternative 'names:name:({words})'{of_zsh} }}",
        fish=f"function {function}; printf '%s\\n' {words}{of_fish}; end",
    )


def _runs() -> Completed:
    return _function(
        "_affinet_runs",
        bash='_affinet_runs() { compgen -d -- "${1:-runs/}"; }',
        zsh='_affinet_runs() { _alternative "runs:run:(${(j: :)${(f)$(print -l runs/*(N/))}})" "files:directory:_files -/" }',
        fish="function _affinet_runs; printf '%s\\n' runs/*/; __fish_complete_directories; end",
    )


def _function(name: str, bash: str, zsh: str, fish: str) -> Completed:
    return {"bash": name, "zsh": name, "fish": f"({name})", "preamble": {"bash": bash, "zsh": zsh, "fish": fish}}


# By what the parser calls a value.
_KNOWN: Mapping[str, Callable[[], Completed]] = {
    "scenario": lambda: _named("scenarios", files.shipped("scenarios"), ".toml"),
    "study": lambda: _named("studies", files.shipped("studies"), ".toml"),
    "estimator": _estimators,
    "directory": _runs,
}
