"""What an algorithm says of itself beyond its methods of every tick, checked; a default where it says nothing."""

from __future__ import annotations

import inspect
from typing import Any, get_args

import numpy as np

from agents.estimators.base import Centre
from agents.swarm import SwarmBrief
from agents.wants import Wants
from analysis.models.arrays import Array
from analysis.models.finding import Finding, Level
from netem.loading.calling import Calling
from netem.loading.returned import WrongReturn, array, is_array, kind


def wants(algorithm: Any) -> Wants:
    """What an estimator or a law wants; nothing by default.

    Raises
    ------
    UserCodeError
        By all functions here: when what it says fails, or is not what it should be.
    """
    if not _says(algorithm, "wants"):
        return Wants()
    with Calling(algorithm, "wants"):
        said = algorithm.wants
        if not isinstance(said, Wants):
            raise WrongReturn(f"must be a Wants, got {kind(said)}")
        for name, wanted in said._asdict().items():
            if type(wanted) is not bool:
                raise WrongReturn(f"wants {name!r} or not, True or False, got {wanted!r}")
        return said


def findings(algorithm: Any, swarm: SwarmBrief) -> list[Finding]:
    """What an estimator or a law finds of a swarm; nothing by default."""
    if not _says(algorithm, "checks"):
        return []
    with Calling(algorithm, "checks"):
        found = algorithm.checks(swarm)
        if not isinstance(found, list | tuple):
            raise WrongReturn(f"must return a list of Findings, got {kind(found)}")
        for one in found:
            _refuse_no_finding(one)
        return list(found)


def counts_missed_ticks(estimator: Any) -> bool:
    """Whether an estimator is to be told of the ticks that its agent missed; not by default."""
    return _says(estimator, "missed")


def step_matrix(law: Any, swarm: SwarmBrief) -> Array | None:
    """One tick of the followers under a law, shape (S, S); None, the default, where nobody knows it."""
    if not _says(law, "step_matrix"):
        return None
    with Calling(law, "step_matrix"):
        step: Array | None = law.step_matrix(swarm.follower_stress, swarm.follower_degree, swarm.dt)
        if step is None:
            return None
        size, followers = len(step) if is_array(step) and step.ndim else 0, len(swarm.follower_degree)
        array("the step", step, "S, S", (size, size), ())
        if size < followers or size % followers:
            raise WrongReturn(f"the step is that of {followers} followers, so S is a multiple of that, not {size}")
        if not np.isfinite(step).all():
            raise WrongReturn("the step has numbers that are not finite")
        return step


def step_gain(law: Any) -> float | None:
    """The gain that decides on the step of a law; None, the default, where no single one does."""
    if not _says(law, "step_gain"):
        return None
    with Calling(law, "step_gain"):
        gain = law.step_gain
        if gain is not None and type(gain) not in (int, float):
            raise WrongReturn(f"must be a number, or None, got {kind(gain)}")
        if gain is not None and not np.isfinite(gain):
            raise WrongReturn(f"must be a finite number, or None, got {gain}")
        return None if gain is None else float(gain)


def centre(estimator: Any, swarm: SwarmBrief) -> Centre[Any] | None:
    """The filter of an estimator that hears everybody; None, the default, where it wants none."""
    if not _says(estimator, "centre"):
        return None
    with Calling(estimator, "centre"):
        made: Centre[Any] | None = estimator.centre(swarm)
        missing = [name for name in ("begin", "step") if not callable(getattr(made, name, None))]
        if made is not None and missing:
            raise WrongReturn(
                f"must return a Centre, or None, got {kind(made)}, which has no method {', '.join(missing)}"
            )
        return made


def _says(algorithm: Any, name: str) -> bool:
    # Not by asking for it: an AttributeError of its own would pass for saying nothing.
    return inspect.getattr_static(algorithm, name, None) is not None


def _refuse_no_finding(given: Any) -> None:
    if not isinstance(given, Finding):
        raise WrongReturn(f"must return a list of Findings, got one of {kind(given)}")
    if type(given.check) is not str or type(given.says) is not str:
        raise WrongReturn(f"a Finding says what was checked and found in texts, got {given.check!r} and {given.says!r}")
    if given.level not in get_args(Level):
        raise WrongReturn(f"a Finding has level {', '.join(map(repr, get_args(Level)))}, not {given.level!r}")
