"""Links that share one setting of the network: which, and what their profile builds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from affinet.planning import traces
from affinet.scenario import profiles, reaches, selectors
from affinet.scenario.air import NetworkSection
from affinet.scenario.profiles import LinkProfile
from affinet.scenario.trace_files import TraceFile
from affinet.scenario.wrong import ScenarioError, said_at
from analysis.models.arrays import Array, Mask
from netem.core.links import Links
from netem.impairments import delay, loss, measured
from netem.impairments import schedule as turns
from netem.impairments.chain import Chain
from netem.impairments.delay import MessageDelay
from netem.impairments.schedule import Schedule
from world.formation.nominal import Formation

SCHEDULES = (profiles.RoundRobin, profiles.Slotted, profiles.DutyCycle)
REACHES = (reaches.Disk, reaches.Ramp, reaches.LogDistance)

_NEVER = 1e-12
_NOTHING = np.empty(0)


@dataclass(frozen=True)
class LinkClass:
    """Links that share one profile.

    Parameters
    ----------
    name
        Of the profile.
    profile
        What it says, with all it is like.
    availability, delay_ticks
        What the network adds to it.
    rows
        The links, shape (L,).
    sensing, comms
        The channel classes.
    measured
        The delays that the profile draws from, in seconds, ascending; empty where it draws from none.
    """

    name: str
    profile: LinkProfile
    availability: float
    delay_ticks: int
    rows: Mask
    sensing: bool
    comms: bool
    measured: Array

    @cached_property
    def chains(self) -> list[tuple[Chain, bool]]:
        """The losses that time decides, each with whether it steps by packet; the first is the network's availability."""
        built = [_chain(model) for model in self.profile.loss or []]
        return [(loss.bernoulli(1.0 - self.availability), False), *(one for one in built if one is not None)]

    @property
    def title(self) -> str:
        """What it is, for people."""
        what = "" if self.sensing and self.comms else (", sensing" if self.sensing else ", comms")
        return f"{int(self.rows.sum())} links, profile {self.name!r}{what}"

    def delays(self, dt: float) -> list[MessageDelay]:
        """What its messages wait, in sum."""
        laws = []
        if self.delay_ticks:
            laws.append(
                MessageDelay(delay.DelayLaw.CONSTANT, self.rows, self.delay_ticks * dt, 0.0, _NOTHING, 0.0, False)
            )
        if (model := self.profile.delay) is not None:
            spread, kept = model.jitter or 0.0, model.order == "kept"
            law = delay.DelayLaw.TABLE if model.trace else delay.DelayLaw(model.model)
            laws.append(MessageDelay(law, self.rows, model.mean or 0.0, spread, self.measured, model.correlation, kept))
        return laws

    def schedule(self, links: Links) -> Schedule:
        """When its links are open; the others always are."""
        match self.losses(SCHEDULES):
            case profiles.RoundRobin() as model:
                period, begins, lasts = turns.round_robin(links, model.hold)
            case profiles.Slotted() as model:
                period, begins, lasts = turns.slotted(links, model.hold)
            case model:
                period, lasts = (np.full(len(links), value) for value in (model.period, model.on))
                begins = np.zeros(len(links), dtype=np.int64)
        always = np.ones(len(links), dtype=np.int64)
        return Schedule(
            np.where(self.rows, period, always),
            np.where(self.rows, begins, 0),
            np.where(self.rows, lasts, always),
            self.sensing,
            self.comms,
        )

    def losses(self, kind: type[Any] | tuple[type[Any], ...]) -> Any:
        """The loss of a kind, None if there is none."""
        return next((model for model in self.profile.loss or [] if isinstance(model, kind)), None)


def classes(network: NetworkSection, formation: Formation, links: Links) -> list[LinkClass]:
    """The distinct settings of links, in the order in which they first appear, for each class of channels.

    Raises
    ------
    ScenarioError
        When a profile is not there, cannot ever deliver, or a selector matches nothing.
    """
    groups = [("sensing", "comms")] if network.coupled else [("sensing",), ("comms",)]
    found: list[LinkClass] = []
    for group in groups:
        settings = [(network.profile, network.availability, network.delay_ticks)] * len(links)
        for number, special in enumerate(network.links, start=1):
            if special.channels is not None and special.channels not in group:
                continue
            if special.profile is not None:
                _resolve(special.profile, network, f"network.links.{number}.profile")
            for row in select(special.links, formation, links, f"network.links.{number}.links"):
                name, availability, ticks = settings[row]
                settings[row] = (
                    special.profile or name,
                    availability if special.availability is None else special.availability,
                    ticks if special.delay_ticks is None else special.delay_ticks,
                )
        for name, availability, ticks in dict.fromkeys(settings):
            rows = np.array([setting == (name, availability, ticks) for setting in settings])
            profile = _resolve(name, network, "network.profile")
            drawn_from = _measured(name, profile)
            one = LinkClass(name, profile, availability, ticks, rows, "sensing" in group, "comms" in group, drawn_from)
            found.append(_possible(one))
    return found


def _measured(name: str, profile: LinkProfile) -> Array:
    table = None if profile.delay is None else profile.delay.table
    if profile.delay is not None and profile.delay.trace is not None:
        return _traced(name, profile.delay.trace)
    if not isinstance(table, str):
        return _NOTHING if table is None else np.sort(np.array(table))
    try:
        return measured.delays(Path(table))
    except FileNotFoundError as error:
        raise ScenarioError(f"network.profiles.{name}: delays {table}: no such file") from error
    except (OSError, ValueError) as error:
        raise ScenarioError(f"network.profiles.{name}: delays {table}: {error}") from error


def _traced(name: str, file: TraceFile) -> Array:
    """The delays that a file says, whenever they held."""
    try:
        return np.sort(traces.said_delays(file))
    except FileNotFoundError as error:
        raise ScenarioError(f"network.profiles.{name}.delay: trace {file.file}: no such file") from error
    except (OSError, ValueError) as error:
        raise ScenarioError(f"network.profiles.{name}.delay: trace {file.file}: {error}") from error


def _possible(one: LinkClass) -> LinkClass:
    """The class itself, if its losses are chains at all, and let anything pass."""
    with said_at(f"network.profiles.{one.name}"):
        passing = np.prod([1.0 - chain.mean_loss for chain, _ in one.chains])
    if passing < _NEVER:
        raise ScenarioError(
            f"network: {one.title}: can never deliver a message; raise its availability, or cut the links in the timeline"
        )
    return one


def select(selector: str, formation: Formation, links: Links, key: str) -> list[int]:
    """Rows of the links that a selector names.

    Parameters
    ----------
    selector
        As a scenario says it.
    formation, links
        Who flies, and over which links.
    key
        That says the selector, for error messages.

    Raises
    ------
    ScenarioError
        Naming the key, when it names none.
    """
    with said_at(key):
        return selectors.rows(selector, formation, links)


def _resolve(name: str, network: NetworkSection, key: str) -> LinkProfile:
    with said_at(key):
        return profiles.resolve(name, network.profiles)


def _chain(model: Any) -> tuple[Chain, bool] | None:
    """A loss that time decides, and whether it steps by packet; None for the other losses."""
    by_packet = getattr(model, "step", "time") == "packet"
    match model:
        case profiles.Bernoulli():
            return loss.bernoulli(model.p), False
        case profiles.Gilbert():
            begins = min(1.0, model.loss / (model.burst * (1.0 - model.loss)))
            return loss.gilbert_elliott(begins, 1.0 / model.burst, extra_delay=model.extra_delay), by_packet
        case profiles.GilbertElliott():
            return loss.gilbert_elliott(model.p, model.r, model.bad, model.good, model.extra_delay), by_packet
        case profiles.Markov():
            return loss.markov(model.p13, model.p31, model.p32, model.p23, model.p14), by_packet
        case profiles.Bursts():
            return loss.bursts(model.loss, model.lengths), False
    return None
