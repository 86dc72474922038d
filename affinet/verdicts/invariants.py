"""Checkers by the words that name them: "bounded(5) & recovers(0.1, within=5)", "always((error < 0.3) | (age > 2))"."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable

from affinet.scenario.words import hint, one_line
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import checkers, pursued, temporal
from affinet.verdicts.checking import Checker
from affinet.verdicts.quantities import Quantity, quantity
from affinet.verdicts.signals import Signal

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
        checkers.below,
        temporal.always,
        temporal.eventually,
        temporal.until,
    )
}
_OF_SIGNALS = {"implies": 1, "until": 1, "eventually": 0, "always": 0}  # and how many of their arguments are signals
_COMPARED: dict[type[ast.cmpop], Callable[[Quantity, float], Signal]] = {
    ast.Lt: Quantity.__lt__,
    ast.LtE: Quantity.__le__,
    ast.Gt: Quantity.__gt__,
    ast.GtE: Quantity.__ge__,
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
            first = [_name(one) if name == "below" else _argument(one) for one in given[:1]]
            return NAMED[name](*first, *map(_argument, given[1:]), **_words(named))
        case ast.Call(ast.Name(name)) | ast.Name(name) if name not in NAMED:
            raise ValueError(f"{name} is no checker; {hint(name, NAMED)}".rstrip("; "))
        case ast.Name(name):
            raise ValueError(f"{name} is written with what it wants: {name}{_parameters(NAMED[name])}")
    raise ValueError(f"{ast.unparse(node)} is no checker")


def _argument(node: ast.expr) -> float | Signal:
    match node:
        case ast.Constant() | ast.UnaryOp(ast.USub() | ast.UAdd()):
            return _number(node)
    return _signal(node)


def _name(node: ast.expr) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    raise ValueError(f"{ast.unparse(node)} is no name of a metric: write it in quotes, like below('nees', 3)")


def _words(given: list[ast.keyword]) -> dict[str, float]:
    words = {str(one.arg): _number(one.value) for one in given}
    if len(words) < len(given):
        raise ValueError("a word is given twice")
    return words


def _signal(node: ast.expr) -> Signal:
    match node:
        case ast.BinOp(left, ast.BitAnd(), right):
            return _signal(left) & _signal(right)
        case ast.BinOp(left, ast.BitOr(), right):
            return _signal(left) | _signal(right)
        case ast.UnaryOp(ast.Invert(), operand):
            return ~_signal(operand)
        case ast.Compare(ast.Name(name), [sign], [level]) if type(sign) in _COMPARED:
            return _COMPARED[type(sign)](quantity(name), _number(level))
        case ast.Call(ast.Attribute(one, method), given, named) if method in _OF_SIGNALS:
            signals, numbers = given[: _OF_SIGNALS[method]], given[_OF_SIGNALS[method] :]
            made: Signal = getattr(_signal(one), method)(
                *map(_signal, signals), *map(_number, numbers), **_words(named)
            )
            return made
    raise ValueError(
        f"{ast.unparse(node)} is no signal: compare a quantity with a number, in brackets, like (error < 0.3)"
    )


def _number(node: ast.expr) -> float:
    try:
        value = ast.literal_eval(node)
    except ValueError:
        value = None
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise ValueError(f"{ast.unparse(node)} is no number")
    return float(value)


def _parameters(made: Callable[..., Checker]) -> str:
    return f"({', '.join(inspect.signature(made).parameters)})"
