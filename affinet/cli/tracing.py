"""`affinet trace`: what link data come to, a chain fitted to them, and the profile."""

from __future__ import annotations

import argparse
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from affinet.cli.show import plain
from affinet.planning import profiling, traces
from affinet.scenario.trace_files import TraceFile
from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from affinet.traces import fitting, goodness, summary
from affinet.traces.fitting import Fit
from affinet.traces.goodness import Goodness
from affinet.traces.link_data import INDIRECT, UNITS, LinkData
from affinet.traces.summary import LinkSummary
from netem.core.listing import listed
from netem.processes.system_errors import said

_SHOWN = 20
_LOOKS = 1.0  # s


class Fitted(NamedTuple):
    """A chain fitted to data, the BIC of each that was tried, and how well it fits."""

    fit: Fit
    tried: Mapping[str, float]
    goodness: Goodness


def trace(parsed: argparse.Namespace) -> None:
    """Say what a file comes to, fit a chain, and write a profile, as far as it was asked for.

    Raises
    ------
    ScenarioError
        When the file is wrong, or does not say what is asked.
    OSError
        When the profile cannot be written.
    """
    file = _meaning(parsed)
    try:
        name, data, notes = traces.told(file, parsed.dt or _LOOKS)
        found = summary.summaries(data)
        fitted = _fitted(parsed.fit, summary.sequences(data, parsed.dt)) if parsed.fit else None
        scaled = None if fitted is None else _scaled(fitted.fit, data, parsed.dt)
    except OSError as error:
        raise ScenarioError(said(error)) from error
    except ValueError as error:
        raise ScenarioError(f"{parsed.file}: {error}") from error
    if parsed.profile is not None:
        step = "time" if parsed.dt else "packet"
        why = f"affinet trace {parsed.file.name}: {_why(name, data, scaled)}"
        profiling.write(
            _profile_name(parsed.file), profiling.profile(data, file, scaled, step, parsed.profile), why, parsed.profile
        )
    if parsed.json:
        print(json.dumps(_told(name, data, notes, found, fitted)))  # noqa: T201
        return
    _show(f"{parsed.file.name}: {name}, {listed(data.nodes)}, {data.ends:g} s", data, found)
    for note in notes:
        _print(f"note: {note}")
    if fitted is not None:
        _show_fit(fitted)
    if parsed.profile is not None:
        _print(f"profile {_profile_name(parsed.file)!r} is in {parsed.profile}")


def _meaning(parsed: argparse.Namespace) -> TraceFile:
    said: dict[str, Any] = {"file": str(parsed.file), "format": parsed.format, "interval": parsed.interval}
    if parsed.begins is not None:
        said["begins"] = parsed.begins
    try:
        if parsed.curve is not None:
            said["curve"] = tomllib.loads(f"curve = {parsed.curve}")["curve"]
        return TraceFile.model_validate(said)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"--curve {parsed.curve}: no TOML: give points like [[-90,0],[-70,1]]") from error
    except ValidationError as error:
        says = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise ScenarioError(one_line(f"--curve {parsed.curve}: {says}; or a loss by distance")) from error


def _fitted(model: str, sequences: Sequence[Any]) -> Fitted:
    if model == "best":
        fit, tried = fitting.best(sequences)
    else:
        fit = fitting.fitted(model, sequences)
        tried = {model: fit.bic}
    return Fitted(fit, tried, goodness.of(fit.chain, sequences))


def _scaled(fit: Fit, data: LinkData, dt: float | None) -> Fit:
    """The chain in steps of a run, if they are asked for, where it was fitted to messages."""
    if dt is None or data.messages is None:
        return fit
    return fitting.in_steps_of(fit, dt / (data.ends / len(data.messages.time)))


def _profile_name(file: Path) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "_", file.stem)


def _why(name: str, data: LinkData, fit: Fit | None) -> str:
    if fit is None:
        return f"{name}, {data.ends:g} s, followed as it is"
    said = f"{name}, {data.ends:g} s, {fit.model} fitted"
    return f"{said}: {_too_little(fit)}" if fit.few else said


def _too_little(fit: Fit) -> str:
    bursts = f"{fit.bursts} burst{'s' * (fit.bursts != 1)} of losses in {fit.messages} steps"
    return f"too little to fit a chain to, {bursts}: the intervals say what is known; with {fitting.FEW} bursts more is"


def _told(
    name: str, data: LinkData, notes: Sequence[str], found: Sequence[LinkSummary], fitted: Fitted | None
) -> dict[str, Any]:
    said: dict[str, Any] = {
        "format": name,
        "nodes": data.nodes,
        "seconds": data.ends,
        "notes": notes,
        "links": [asdict(one) for one in found],
    }
    if fitted is not None:
        fit = fitted.fit
        said["fit"] = {
            "model": fit.model,
            "steps": fit.messages,
            "bursts": fit.bursts,
            "too_little": fit.few,
            "parameters": {name: one._asdict() for name, one in fit.parameters.items()},
            "log_likelihood": fit.log_likelihood,
            "bic": dict(fitted.tried),
            "goodness": asdict(fitted.goodness) | {"refused": fitted.goodness.refused},
        }
    return said


def _show(title: str, data: LinkData, found: Sequence[LinkSummary]) -> None:
    told = [_cells(data, one) for one in found]
    names = [name for name in (told[0] if told else {}) if any(cells[name] for cells in told)]
    unit = "messages in a row" if data.messages is not None else "s"
    table = Table("link", title=plain(title), caption=f"outages in {unit}, delays in ms, rates in kbit/s")
    for name in names:
        table.add_column(name, justify="right")
    for one, cells in list(zip(found, told, strict=True))[:_SHOWN]:
        table.add_row(plain(one.link), *(cells[name] or "-" for name in names))
    Console().print(table)
    if len(found) > _SHOWN:
        _print(f"and {len(found) - _SHOWN} links more: --json has all")


def _cells(data: LinkData, one: LinkSummary) -> dict[str, str]:
    """What is said of a link, by column; nothing where nothing is."""
    gone, late, seen = one.outages, one.delays_s, one.measured
    what = next((f"{what} ({UNITS[what]})" for what in INDIRECT if what in data.steps), "")
    return {
        "loss": _figure(one.loss),
        "outages": "" if gone is None else f"{gone.number}",
        "mean": "" if gone is None else _figure(gone.mean),
        "longest": "" if gone is None else _figure(gone.longest),
        "delay": "" if late is None else _figure(1e3 * late[0]),
        "median": "" if late is None else _figure(1e3 * late[1]),
        "95 %": "" if late is None else _figure(1e3 * late[2]),
        "rate": "" if one.rate is None else _figure(one.rate / 1e3),
        "reordered": _figure(one.reordered),
        "doubled": _figure(one.doubled),
        **({} if not what else {f"{what} least": "" if seen is None else _figure(seen[0])}),
        **({} if not what else {"on average": "" if seen is None else _figure(seen[1])}),
        **({} if not what else {"most": "" if seen is None else _figure(seen[2])}),
    }


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _show_fit(fitted: Fitted) -> None:
    fit, fits = fitted.fit, fitted.goodness
    table = Table("parameter", "value", "95 % from", "to", title=f"{fit.model}, fitted to {fit.messages} steps")
    for name, one in fit.parameters.items():
        table.add_row(name, f"{one.value:.4g}", f"{one.low:.4g}", f"{one.high:.4g}")
    Console().print(table)
    if len(fitted.tried) > 1:
        tried = ", ".join(f"{name} {bic:.1f}" for name, bic in fitted.tried.items())
        _print(f"BIC (the least is best): {tried}")
    _print(f"mean loss {fit.chain.mean_loss:.4g}, mean burst {fit.chain.mean_burst:.3g} steps")
    _print(
        f"goodness of fit: p = {fits.p:.3g} (bursts {fits.bursts:.3g}, gaps {fits.gaps:.3g}, "
        f"spread over time {fits.spread:.3g})"
    )
    cannot = "the chain cannot have made these data: fit another, or follow the file"
    _print(cannot if fits.refused else "too little to say" if fit.few else "nothing speaks against the chain")
    if fit.few:
        _print(f"note: {_too_little(fit)}")


def _print(text: str) -> None:
    print(one_line(text))  # noqa: T201
