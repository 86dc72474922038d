"""Checkers by the words that name them: "bounded(5) & recovers(0.1, within=5)"."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable

from affinet.scenario.words import hint, one_line
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import checkers, pursued
from affinet.verdicts.checking import Checker

NAMED: dict[str, Callable[..., Checker]] = {
    made.__name__: made
    for made in (
        checkers.bounded,
        checkers.converged,
        checkers.recovers,
        checkers.never_heard_across_a_cut,
        checkers.consistent,
        checkers.collision_free,
        checkers.agreement,
        checkers.energy,
        checkers.localized,
        checkers.smooth,
        pursued.found,
        pursued.agreed,
    )
}


def parse(text: str) -> Checker:
    """The checker that the text says.

    Raises
    ------
    ScenarioError
        When it says none: which words there are.
    """
    try:
        return _built(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, TypeError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        known = ", ".join(f"{name}{_parameters(made)}" for name, made in NAMED.items())
        raise ScenarioError(
            f"invariant {text!r}: {one_line(str(error))}; there are {known}, and & | ~ between them"
        ) from error


def _built(node: ast.expr) -> Checker:
    match node:
        case ast.BinOp(left, ast.BitAnd(), right):
            return _built(left) & _built(right)
        case ast.BinOp(left, ast.BitOr(), right):
            return _built(left) | _built(right)
        case ast.UnaryOp(ast.Invert(), operand):
            return ~_built(operand)
        case ast.Call(ast.Name(name), given, named) if name in NAMED:
            return NAMED[name](*map(_number, given), **{str(one.arg): _number(one.value) for one in named})
        case ast.Call(ast.Name(name)) | ast.Name(name) if name not in NAMED:
            raise ValueError(f"{name} is no checker; {hint(name, NAMED)}".rstrip("; "))
        case ast.Name(name):
            raise ValueError(f"{name} is written with what it wants: {name}{_parameters(NAMED[name])}")
    raise ValueError(f"{ast.unparse(node)} is no checker")


def _number(node: ast.expr) -> float:
    value = ast.literal_eval(node)
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise ValueError(f"{ast.unparse(node)} is no number")
    return float(value)


def _parameters(made: Callable[..., Checker]) -> str:
    return f"({', '.join(inspect.signature(made).parameters)})"
