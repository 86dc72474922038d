"""`affinet completion`: what completes the command line in bash, zsh and fish, made from the parser and from what there is."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from affinet.scenario import files

_FLAG = 0  # of nargs: an option that takes no value


class Values(NamedTuple):
    """What a value may be: one of these words, and files that match a pattern, or directories ("/")."""

    words: tuple[str, ...] = ()
    files: str = ""


class Option(NamedTuple):
    """An option: its flags, what it is for, and its values; None where it takes none."""

    flags: tuple[str, ...]
    says: str
    values: Values | None


class Command(NamedTuple):
    """A command: its word, what it is for, its options, and what stands behind it without a dash."""

    word: str
    says: str
    options: tuple[Option, ...]
    values: Values


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Take `affinet completion` in."""
    completion = commands.add_parser(
        "completion",
        help="print what completes the command line in a shell",
        description="Print a script that completes commands, options, names of scenarios, estimators and studies, and run "
        "directories. Print it again when you have installed what brings names of its own.",
    )
    completion.add_argument("shell", choices=sorted(SHELLS), metavar="SHELL", help="bash, zsh or fish")


def script(shell: str, whole: argparse.ArgumentParser) -> str:
    """What completes the command line that this parser reads."""
    return SHELLS[shell](list(_commands(whole)))


def _commands(whole: argparse.ArgumentParser) -> Iterator[Command]:
    (commands,) = (action for action in whole._actions if isinstance(action, argparse._SubParsersAction))
    says = {action.dest: action.help or "" for action in commands._choices_actions}
    for word, parser in commands.choices.items():
        known = [_values(action) for action in parser._actions if not action.option_strings]
        words = tuple(dict.fromkeys(name for values in known for name in values.words))
        yield Command(
            word,
            says[word],
            tuple(
                Option(tuple(action.option_strings), action.help or "", None if action.nargs == _FLAG else _values(action))
                for action in parser._actions
                if action.option_strings
            ),
            Values(words, next((values.files for values in known if values.files), "")),
        )


def _values(action: argparse.Action) -> Values:
    if action.choices is not None:
        return Values(tuple(map(str, action.choices)))
    return _KNOWN[action.dest]() if action.dest in _KNOWN else Values()


def _estimators() -> Values:
    from affinet.planning import registry

    return Values(tuple(registry.names(registry.ESTIMATORS)))


# By what the parser calls a value.
_KNOWN: Mapping[str, Callable[[], Values]] = {
    "scenario": lambda: Values(tuple(files.shipped("scenarios")), "*.toml"),
    "study": lambda: Values(tuple(files.shipped("studies")), "*.toml"),
    "estimator": _estimators,
    "directory": lambda: Values(files="runs/"),
    "file": lambda: Values(files="*.toml"),
    "out": lambda: Values(files="/"),
    "keys": lambda: Values(files="/"),
}


def _bash(commands: list[Command]) -> str:
    lines = [
        "_affinet() {",
        "    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]} command=${COMP_WORDS[1]} IFS=$'\\n'",
        "    if (( COMP_CWORD == 1 )); then",
        f"        COMPREPLY=($({_bash_words(Values((*(one.word for one in commands), '--help', '--version')))}))",
        "        return",
        "    fi",
        '    case "$command $prev" in',
    ]
    for command in commands:
        for option in command.options:
            if option.values is not None:
                pattern = "|".join(f'"{command.word} {flag}"' for flag in option.flags)
                lines.append(f"        {pattern}) COMPREPLY=($({_bash_words(option.values)})); return ;;")
    lines += ["    esac", '    case "$command $cur" in']
    for command in commands:
        flags = Values(tuple(flag for option in command.options for flag in option.flags))
        lines.append(f'        "{command.word} -"*) COMPREPLY=($({_bash_words(flags)})) ;;')
        lines.append(f'        "{command.word} "*) COMPREPLY=($({_bash_words(command.values)})) ;;')
    return "\n".join([*lines, "    esac", "}", "complete -o filenames -F _affinet affinet", ""])


def _bash_words(values: Values) -> str:
    said = []
    if values.words:
        said.append(f"compgen -W $'{chr(92) + 'n'}'{_quoted(chr(10).join(values.words))} -- \"$cur\"")
    if values.files == "/":
        said.append('compgen -d -- "$cur"')
    elif values.files.endswith("/"):
        said += [f'compgen -d -- "${{cur:-{values.files}}}"']
    elif values.files:
        said += [f"compgen -f -X '!{values.files}' -- \"$cur\"", 'compgen -d -- "$cur"']
    return "; ".join(said) or ":"


def _zsh(commands: list[Command]) -> str:
    lines = ["#compdef affinet", "_affinet() {", "    local -a commands=("]
    lines += [f"        {_quoted(f'{one.word}:{_colons(one.says)}')}" for one in commands]
    lines += [
        "    )",
        "    if (( CURRENT == 2 )); then",
        "        _describe command commands",
        "        return",
        "    fi",
        "    local word=$words[2]",
        "    shift words",
        "    (( CURRENT-- ))",
        "    case $word in",
    ]
    for command in commands:
        lines.append(f"        {command.word})")
        lines.append("            _arguments \\")
        for option in command.options:
            takes = "" if option.values is None else f": :{_zsh_words(option.values)}"
            lines += [f"                {_quoted(f'*{flag}[{_brackets(option.says)}]{takes}')} \\" for flag in option.flags]
        lines.append(f"                {_quoted(f'*: :{_zsh_words(command.values)}')} ;;")
    return "\n".join([*lines, "    esac", "}", "compdef _affinet affinet", ""])


def _zsh_words(values: Values) -> str:
    words = f"({' '.join(values.words)})" if values.words else ""
    if not values.files:
        return words or " "
    found = "_files -/" if values.files.endswith("/") else f'_files -g "{values.files}"'
    return f"_alternative 'words:word:{words}' 'files:file:{found}'".replace("'", '"') if words and False else (
        "{_alternative " + _quoted(f"words:word:{words}") + " " + _quoted(f"files:file:{found}") + "}" if words else found
    )


def _fish(commands: list[Command]) -> str:
    lines = ["complete -c affinet -f", "set -l any __fish_use_subcommand"]
    lines += [f"complete -c affinet -n __fish_use_subcommand -a {one.word} -d {_quoted(one.says)}" for one in commands]
    for command in commands:
        of = f"complete -c affinet -n {_quoted(f'__fish_seen_subcommand_from {command.word}')}"
        for option in command.options:
            flags = " ".join(f"-l {flag[2:]}" if flag.startswith("--") else f"-s {flag[1:]}" for flag in option.flags)
            takes = "" if option.values is None else f" -x{_fish_words(option.values)}"
            lines.append(f"{of} {flags}{takes} -d {_quoted(option.says)}")
        if (words := _fish_words(command.values)):
            lines.append(f"{of}{words}")
    return "\n".join([*lines, ""])


def _fish_words(values: Values) -> str:
    words = [*values.words]
    if values.files.endswith("/"):
        words.append("(__fish_complete_directories)" if values.files == "/" else f"({_FISH_RUNS})")
    elif values.files:
        words.append("(__fish_complete_suffix .toml)")
    return f" -a {_quoted(' '.join(words))}" if words else ""


_FISH_RUNS = "path filter -d runs/* 2>/dev/null"


def _quoted(text: str) -> str:
    """As one word of a shell."""
    return "'" + text.replace("'", "'\\''") + "'"


def _colons(text: str) -> str:
    return text.replace(":", "\\:")


def _brackets(text: str) -> str:
    return _colons(text.replace("%(default)s", "").replace("[", "(").replace("]", ")"))


SHELLS: Mapping[str, Callable[[list[Command]], str]] = {"bash": _bash, "zsh": _zsh, "fish": _fish}
