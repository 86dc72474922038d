"""From a run that was flown: the model of its inputs that filters predict lost ones by."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from analysis.models import autoregressive
from analysis.models.autoregressive import Model
from world.books import history


def inputs(directory: Path, order: int) -> Model:
    """An autoregressive model of the inputs of all agents of a run, each axis a signal of its own.

    Parameters
    ----------
    directory
        The run directory.
    order
        p, how many earlier ticks it takes in.

    Raises
    ------
    ScenarioError
        When it holds no run, or a damaged one, or one of double integrators, or nothing in it moves.
    """
    if (bodies := loading.resolved(directory).dynamics.model) != "single-integrator":
        raise ScenarioError(
            f"{directory}: what its {bodies}s are given is not their velocity; the filters that predict inputs want that"
        )
    try:
        flown = history.load(directory / history.ARRAYS, only=["input"])["input"]
        return autoregressive.fit(flown[np.isfinite(flown).all(axis=(1, 2))], order)
    except history.Damaged as error:
        raise ScenarioError(str(error)) from error
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{directory}: {error}") from error


def overrides(model: Model) -> list[str]:
    """What to set so that the filters use it."""
    a = ", ".join(f"{one:.6g}" for one in model.coefficients)
    filters = [
        f"agents.parameters.{name}={{ coefficients = [{a}], sigma_n = {model.sigma_n:.6g} }}"
        for name in ("edge-kf", "joint-kf")
    ]
    if len(model.coefficients) == 1:
        filters.append(f"agents.parameters.silent-kf={{ coefficient = {a}, sigma_u = {model.sigma_u:.6g} }}")
    return filters
