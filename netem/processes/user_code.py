"""What a user's own code does wrong, said so that it can be found: class and method, the error, file and line."""

from __future__ import annotations

import inspect
import opcode
import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, NamedTuple

# The packages at the top that affinet is made of: one in a wheel, which has its rooms within; in a checkout they lie beside it.
OURS = frozenset(
    {"affinet"} if __name__.startswith("affinet.") else {"affinet", "agents", "world", "netem", "analysis"}
)
_LIBRARIES = tuple(sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib"))
_LONGEST = 400
_RAISE = opcode.opmap["RAISE_VARARGS"]


class UserCodeError(RuntimeError):
    """An estimator, a law, a checker or a module of the user's own failed.

    Parameters
    ----------
    where
        Class and method, or module.
    what
        The error.
    place
        File and line.

    Attributes
    ----------
    tick
        In which it was called; None before take-off.
    during
        What was being flown, for people, where that is not plain.
    """

    def __init__(self, where: str, what: str, place: str) -> None:
        super().__init__(where, what, place)
        self.where, self.what, self.place = where, what, place
        self.tick: int | None = None
        self.during: str | None = None

    def __str__(self) -> str:
        start = "" if self.during is None else f"{self.during}: "
        when = "" if self.tick is None else f" in tick {self.tick}"
        return f"{start}{self.where}{when}: {self.what} ({self.place})"


@contextmanager
def in_tick(tick: int) -> Iterator[None]:
    """What a user's own code does wrong in the block is done in this tick."""
    try:
        yield
    except UserCodeError as error:
        error.tick = tick
        raise


class _Step(NamedTuple):
    file: str
    line: int
    package: str


def worded(error: BaseException) -> str:
    """An error with its type, in one line."""
    if isinstance(error, SystemExit):
        return "it called sys.exit(), and only the run may end the run"
    line = "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in " ".join(text_of(error).split()))
    if len(line) > _LONGEST:
        line = f"{line[:_LONGEST]} ..."
    return f"{type(error).__name__}: {line}" if line else type(error).__name__


def text_of(error: BaseException) -> str:
    """What an error says, as far as it can say anything, in characters that can be written to any file."""
    try:
        said = str(error.msg if isinstance(error, SyntaxError) else error)
    except BaseException as another:  # its text is the user's own code too, and may do anything
        if is_of_a_signal(another):
            raise
        return f"(its text cannot be had: {type(another).__name__})"
    return said.encode("utf-8", "backslashreplace").decode("utf-8")


def place_of(error: BaseException, package: str) -> str | None:
    """File and line of the last step of an error inside a package, or inside files that nobody installed.

    None where it never got there: it came of the call itself.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno}"
    steps = _steps(error.__traceback__)[1:]  # the first is the call
    theirs = [step for step in steps if step.package == package or not (_is_ours(step) or _is_installed(step))]
    return f"{theirs[-1].file}:{theirs[-1].line}" if theirs else None


def definition(of: Any) -> str:
    """File and line where a class, method or module is written."""
    written = of if isinstance(of, type) else inspect.unwrap(of)
    try:
        file = inspect.getsourcefile(written) or inspect.getfile(written)
        line = 1 if inspect.ismodule(written) else inspect.getsourcelines(written)[1]
    except (OSError, TypeError):
        return f"module {getattr(written, '__module__', '?')}"
    return f"{file}:{line}"


def is_of_a_signal(error: BaseException) -> bool:
    """Whether it is the exit that a signal handler of ours asks for, or Ctrl-C, wherever it met the user's code."""
    steps = _steps(error.__traceback__)
    if not isinstance(error, SystemExit | KeyboardInterrupt):
        return False
    if len(steps) > 1 and _is_ours(steps[-1]):
        return True
    return isinstance(error, KeyboardInterrupt) and not _was_raised_by_code(error)


def _was_raised_by_code(error: BaseException) -> bool:
    """Whether a `raise` stands where an error began; Python's own handler of signals leaves none."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is not None and trace.tb_frame.f_code.co_code[trace.tb_lasti] == _RAISE


def _steps(trace: TracebackType | None) -> list[_Step]:
    return [
        _Step(frame.f_code.co_filename, line, str(frame.f_globals.get("__name__", "")).partition(".")[0])
        for frame, line in traceback.walk_tb(trace)
    ]


def _is_ours(step: _Step) -> bool:
    return step.package in OURS


def _is_installed(step: _Step) -> bool:
    return step.file.startswith(("<", *_LIBRARIES))
