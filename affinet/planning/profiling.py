"""A profile of link data: what a scenario says so that its links are like those that were measured."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from affinet.scenario.profiles import LinkProfile
from affinet.scenario.trace_files import TraceFile
from affinet.scenario.wrong import ScenarioError
from affinet.traces.fitting import Fit
from affinet.traces.link_data import LinkData, Quantity
from analysis.models.arrays import Array

_QUANTILES = 50


def profile(data: LinkData, file: TraceFile, fit: Fit | None, step: str, out: Path) -> dict[str, Any]:
    """The table of a profile.

    Parameters
    ----------
    data, file
        What was measured, and the file that says it.
    fit
        The chain in place of the file, if one was fitted.
    step
        Of the chain: "time", once a tick, or "packet".
    out
        Where it will be written: paths in it count from there.
    """
    said: dict[str, Any] = {}
    meaning = file.model_dump(exclude_defaults=True, exclude={"file"})
    where = os.path.relpath(os.path.abspath(file.file), os.path.abspath(out.parent))
    if fit is not None:
        own = {name: float(f"{one.value:.6g}") for name, one in fit.parameters.items()}
        said["loss"] = [{"model": fit.model, **own, **({} if fit.model == "bernoulli" else {"step": step})}]
    elif Quantity.AVAILABILITY in data.steps:
        said["loss"] = [{"model": "trace", "file": where, **meaning}]
    if data.messages is not None:
        arrived = ~data.messages.lost
        said["delay"] = {"model": "table", "table": _quantiles(data.messages.delay[arrived])}
        if doubled := int(data.messages.doubled.sum()):
            said["duplicate"] = float(f"{doubled / arrived.sum():.6g}")
        return said
    direct = file.model_dump(exclude_defaults=True, exclude={"file", "curve"})
    if Quantity.DELAY in data.steps:
        said["delay"] = {"model": "trace", "trace": {"file": where, **direct}}
    if Quantity.RATE in data.steps and not data.offered:
        said["rate"] = {"trace": {"file": where, **direct}}
    return said


def write(name: str, said: dict[str, Any], why: str, out: Path) -> None:
    """Write a profile as a part of a scenario, to a place where nothing is.

    Parameters
    ----------
    name, said
        Of the profile, and its table.
    why
        What it was made of, for people.
    out
        The file.

    Raises
    ------
    ScenarioError
        When there would be nothing in it.
    OSError
        When something is there already, or it cannot be written.
    """
    if not said:
        raise ScenarioError(f"{out}: nothing of what was measured is a loss or a delay: there is no profile of it")
    LinkProfile.model_validate(said)
    with out.open("x", encoding="utf-8") as file:
        file.write(f"# {why}\n{tomli_w.dumps({'network': {'profiles': {name: said}}})}")


def _quantiles(delays: Array) -> list[float]:
    """Delays as a table: all of them where they are few, else as many in the middle of equal shares."""
    if len(delays) <= _QUANTILES:
        return sorted(float(f"{one:.6g}") for one in delays.tolist())
    shares = (np.arange(_QUANTILES) + 0.5) / _QUANTILES
    return [float(f"{one:.6g}") for one in np.quantile(delays, shares).tolist()]
