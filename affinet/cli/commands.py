"""The `affinet` command.

Exit status: 0 pass, 1 fail or vacuous, 2 bad input, 3 a user's own code failed (estimator, law or module), 130 interrupted;
143 or 129 where SIGTERM or SIGHUP ended a run.
"""

from __future__ import annotations

import argparse
import errno
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import NoReturn

from affinet.cli import helping, options, terminal
from affinet.cli.importing import ctrl_c_left_to_the_system
from affinet.cli.status import BAD_INPUT, INTERRUPTED, PASS, USER_CODE
from affinet.runtimes.interruption import Interrupted
from affinet.scenario.words import one_line
from netem.core.refusal import Refusal
from netem.processes.leaving import leave, status_of
from netem.processes.system_errors import said
from netem.processes.user_code import UserCodeError

# What does the work of each command, module and function: imported when it is called, and nothing else is.
_WORK: Mapping[str, tuple[str, str]] = {
    "run": ("flying", "run"),
    "check": ("checking", "check"),
    "replay": ("replaying", "replay"),
    "check-determinism": ("replaying", "check_determinism"),
    "watch": ("watching", "watch"),
    "render": ("rendering", "render"),
    "compare": ("comparing", "compare"),
    "diff": ("differing", "diff"),
    "report": ("reporting", "report"),
    "export": ("exporting", "write"),
    "fit": ("fitting", "fit"),
    "trace": ("tracing", "trace"),
    "inject": ("injecting", "inject"),
    "study": ("studying", "fly_and_report"),
    "score": ("scoring", "fly_and_report"),
    "hunt": ("hunting", "hunt_and_report"),
    "conformance": ("conforming", "judge_and_report"),
    "design": ("designing", "design"),
    "keys": ("certifying", "write"),
    "hosts": ("flying", "hosts"),
    "world": ("flying", "world"),
    **dict.fromkeys(("agent", "host", "netem"), ("machines", "hold")),
    "list": ("listing", "print_list"),
    "schema": ("schemas", "print_schema"),
    "new": ("scaffolding", "write"),
    "doctor": ("doctoring", "examine"),
    "completion": ("completing", "write"),
}


def command() -> NoReturn:
    """What the shell starts: the process ends here with the command's exit status, whatever threads a module has started."""
    terminal.settle()
    status = status_of(main)
    try:
        if sys.stdout is not None:  # it was closed
            sys.stdout.flush()
    except OSError as error:
        if status != BAD_INPUT:  # else it has said already what came in between
            print(one_line(said(error)), file=sys.stderr)  # noqa: T201
        status = status or BAD_INPUT  # the answer did not get out
    leave(status)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = options.parser()
    parsed = parser.read(arguments)
    if parsed.command is None:
        print(helping.guide(parser), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    try:
        status = _work(parsed.command)(parsed)
    except Refusal as error:
        print(one_line(str(error)), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except UserCodeError as error:
        print(f"{error}; traceback: {_kept(error)}", file=sys.stderr)  # noqa: T201
        return USER_CODE
    except OSError as error:
        print(one_line(said(error)), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except RuntimeError as error:
        if (refused := _refused(error)) is None:
            raise
        print(one_line(refused), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except Interrupted as error:
        print(error, file=sys.stderr)  # noqa: T201
        return error.status
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)  # noqa: T201
        return INTERRUPTED
    return PASS if status is None else status


def _work(word: str) -> Callable[[argparse.Namespace], int | None]:
    """What does the work of a command; its exit status, where it is not always 0."""
    module, name = _WORK[word]
    with ctrl_c_left_to_the_system():
        work: Callable[[argparse.Namespace], int | None] = getattr(import_module(f"affinet.cli.{module}"), name)
    return work


def _kept(error: UserCodeError) -> str:
    """The file that has the traceback, as there is no run directory; or why none has it."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="affinet-", suffix=".log", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as log:
            traceback.print_exception(error, file=log)
    except OSError as refused:
        return f"not kept, {said(refused)}"
    return log.name


def _refused(error: RuntimeError) -> str | None:
    """In one line what the system refused, where a library says so by an error of its own."""
    from concurrent.futures import BrokenExecutor  # it takes a while to import

    if isinstance(error, BrokenExecutor):
        return f"a worker process ended: {error}; was there memory enough, and room for its threads (ulimit -v, -u)?"
    if "can't start new thread" in str(error):
        return said(OSError(errno.EAGAIN, str(error)))
    return None
