"""Estimators, laws and impairments by name: entry points of any installed package, or "module:Class"."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, NamedTuple

from affinet.planning import limits
from affinet.scenario.profiles import IMPAIRMENTS
from affinet.scenario.words import among, one_line
from affinet.scenario.wrong import ScenarioError
from agents.estimators.base import Estimator
from agents.laws.base import Law
from netem.impairments.own import Loss
from netem.loading import modules, parameters
from netem.loading.calling import Calling, NoSuchAlgorithm, load, name_of
from netem.loading.choice import Choice
from netem.loading.offers import offered
from netem.loading.parameters import ParameterError
from netem.processes.user_code import UserCodeError, definition, text_of

ESTIMATORS = "affinet.estimators"
LAWS = "affinet.controllers"


class _Kind(NamedTuple):
    """What algorithms of a group have to be, and the page that says it."""

    protocol: type
    methods: tuple[str, ...]
    page: str


_KINDS: Mapping[str, _Kind] = {
    ESTIMATORS: _Kind(Estimator, ("channels", "init", "sense", "fuse"), "docs/estimators.md"),
    LAWS: _Kind(Law, ("init", "command"), "docs/laws.md"),
    IMPAIRMENTS: _Kind(Loss, ("lost",), "docs/extending.md"),
}


def names(group: str) -> list[str]:
    """The names that installed packages offer in a group."""
    return sorted(offered(group))


def choose(group: str, key: str, name: str, given: Mapping[str, Any], own: Mapping[str, Path]) -> Choice:
    """The algorithm of this name with these parameters, checked against its fields.

    Parameters
    ----------
    group
        `ESTIMATORS`, `LAWS` or `IMPAIRMENTS`.
    key
        Of the scenario, for error messages.
    name
        An entry point, or "module:Class".
    given
        Its parameters; those not given keep their defaults.
    own
        Folders in which modules of the user's own lie, by "module:Class".

    Raises
    ------
    ScenarioError
        When there is no such algorithm, or it has no such parameter, or a value does not fit.
    UserCodeError
        When its module cannot be imported, or it is not what an algorithm of this group has to be.
    """
    path = _path(group, key, name)
    algorithm = loaded(group, key, path, own.get(name))
    table = key if group == IMPAIRMENTS else f"agents.parameters.{name}"  # parameters stand beside an impairment's name
    return _made(table, name, path, algorithm, given, own.get(name))


def loaded(group: str, key: str, path: str, folder: Path | None) -> type:
    """The class at "module:Class" of a folder, or of an installed package, which is an algorithm of this group.

    Parameters
    ----------
    group, key
        Which, and the key that names it, for error messages.
    path, folder
        The class, and where its module lies; None for one that is installed.

    Raises
    ------
    ScenarioError
        When there is none.
    UserCodeError
        When its module cannot be imported, or it is not what an algorithm of this group has to be.
    """
    algorithm = _load(key, path, folder)
    _refuse_another_kind(group, algorithm)
    return algorithm


def check_parameters(given: Mapping[str, Mapping[str, Any]], own: Mapping[str, Path]) -> None:
    """Refuse parameters that do not fit, also of algorithms that are not in use: a study may choose them.

    Raises
    ------
    ScenarioError
        When there is no such algorithm, or it has no such parameter, or a value does not fit.
    UserCodeError
        When its module cannot be imported.
    """
    if not given:
        return
    known = {name: path for group in (ESTIMATORS, LAWS) for name, path in offered(group).items()}
    for name, table in given.items():
        key = f"agents.parameters.{name}"
        if name not in known and ":" not in name:
            raise ScenarioError(f"{key}: no such estimator or law; {among(name, sorted(known))}")
        path = known.get(name, name)
        _made(key, name, path, _load(key, path, own.get(name)), table, own.get(name))


def refuse_other(algorithm: Any, name: str, fits: Callable[[Any], bool], what: str) -> None:
    """Refuse an algorithm that does not say what it has to, or says something else.

    Parameters
    ----------
    algorithm, name
        Which, and the attribute by which it says it.
    fits, what
        Whether it may say so, and what it says by it, for error messages.

    Raises
    ------
    UserCodeError
        When it fails to say, or says something that does not fit.
    """
    with Calling(algorithm, name):
        said = getattr(algorithm, name, None)
        has = None if fits(said) else f"has no {name!r}: {what}" if said is None else f"{name!r} is {said!r}: {what}"
    if has is not None:
        raise UserCodeError(name_of(type(algorithm)), has, definition(type(algorithm)))


@contextmanager
def refusing(key: str, refusal: type[ValueError]) -> Iterator[None]:
    """What an algorithm refuses by such an error is a problem of the scenario's key; whatever else it does is its own."""
    try:
        yield
    except UserCodeError as error:
        if isinstance(error.__cause__, refusal):
            raise ScenarioError(f"{key}: {one_line(text_of(error.__cause__))}") from error
        raise


def _path(group: str, key: str, name: str) -> str:
    if ":" in name:
        return name
    known = offered(group)
    if name not in known:
        raise ScenarioError(f"{key}: no {name!r}; {among(name, sorted(known))}, or give 'module:Class'")
    return known[name]


def _load(key: str, path: str, folder: Path | None) -> type:
    try:
        algorithm = load(path, None if folder is None else str(folder))
    except NoSuchAlgorithm as error:
        only_there = "; only the script or notebook that made it has it" if modules.is_running(path) else ""
        raise ScenarioError(f"{key}: cannot load {path}: {error}{only_there}") from error
    if not is_dataclass(algorithm):
        raise UserCodeError(name_of(algorithm), "is not a dataclass of its parameters", definition(algorithm))
    return algorithm


def _made(key: str, name: str, path: str, algorithm: type, given: Mapping[str, Any], folder: Path | None) -> Choice:
    try:
        with Calling(algorithm, "__init__"):
            parameters.arguments(algorithm, given)
    except UserCodeError as error:
        if isinstance(refused := error.__cause__, ParameterError):
            known = ", ".join(parameters.names(algorithm)) or "no parameters"
            where, says = ".".join([key, *refused.path]), refused.says
            raise ScenarioError(f"{where}: {says}; {name} has {known}") from error
        raise
    limits.parameters(key, given)
    choice = Choice(path, dict(given), None if folder is None else str(folder))
    with refusing(key, ValueError):
        choice.build()
    return choice


def _refuse_another_kind(group: str, algorithm: type) -> None:
    kind = _KINDS[group]
    missing = [method for method in kind.methods if not _has(algorithm, method, kind.protocol)]
    if missing:
        has_no = f"has no method {', '.join(missing)}: {kind.protocol.__name__} in {kind.page} says what each does"
        raise UserCodeError(name_of(algorithm), has_no, definition(algorithm))


def _has(algorithm: type, method: str, protocol: type) -> bool:
    with Calling(algorithm, method):
        written = getattr(algorithm, method, None)
    unwritten: frozenset[str] = getattr(algorithm, "__abstractmethods__", frozenset())
    return callable(written) and written is not getattr(protocol, method) and method not in unwritten
