"""What fits: a run into the memory of a machine, its delays into the run, and the parameters of algorithms into floats."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from typing import Any

import numpy as np

from affinet.planning.link_classes import LinkClass
from affinet.scenario.bounds import LARGEST, SMALLEST
from affinet.scenario.sections import Scenario, TimeSection, TrustSection
from affinet.scenario.wrong import ScenarioError
from analysis.models.finding import Finding
from netem.core.links import Links
from world.books.history import forms
from world.formation.nominal import Formation
from world.physics.world import World

_COPIES = 2  # of the maps, the launcher's and the world's; of arrays, they and what is made of them at the end
_AROUND = 512  # bytes of a message beside its numbers: names, and what it is of
_AT_WORK = 4  # arrays like the covariance of the disturbances, while it is put together
_LEAST_OF_A_TICK = 1e-6  # a delay below this share of a tick would pass as none


def first_tick(given: Scenario) -> Scenario:
    """The scenario, over after one tick: what does not grow with the run is all there."""
    return given.model_copy(update={"time": given.time.model_copy(update={"duration": given.time.dt})})


def swarm(formation: Formation, links: Links, memory: int) -> Finding:
    """Whether what agents are told of each other fits into a memory of so many bytes."""
    edges = links.slots.shape[1] * formation.dimension
    needed = _AT_WORK * np.dtype(np.float64).itemsize * formation.agents * edges**2
    return _fits(
        needed,
        memory,
        f"{formation.agents} agents with up to {links.slots.shape[1]} neighbours",
        "give them fewer edges",
    )


def run(first: World, time: TimeSection, memory: int) -> Finding:
    """Whether a run fits into a memory of so many bytes: what happens in it goes to disk, where it is to fly is in memory.

    Parameters
    ----------
    first
        The world of its first tick.
    time
        Of the run.
    memory
        Of the machine, in bytes.
    """
    maps = (first.manoeuvre.theta, first.manoeuvre.offset)
    copies = _COPIES + int(first.formation.is_leader.sum())
    return _ticks_fit(copies * sum(of_ticks[0].nbytes for of_ticks in maps), first, time.ticks, memory)


def rehearsal(world: World, channels: int, reports: Mapping[str, tuple[int, ...]], memory: int) -> Finding:
    """Whether all that happens in a run fits into a memory of so many bytes, where it is not written to disk.

    Parameters
    ----------
    world
        What is flown.
    channels, reports
        How many channels there are, and what the estimator reports, by name, with the shape for one agent.
    memory
        Of the machine, in bytes.
    """
    each = _COPIES * of_a_tick(world, channels, reports)
    return _ticks_fit(each, world, world.ticks, memory, "; or give a run directory (out)")


def of_a_tick(world: World, channels: int, reports: Mapping[str, tuple[int, ...]]) -> int:
    """How many bytes there are in the arrays of a tick, of a world, over so many channels, with these reports."""
    return sum(array.dtype.itemsize * prod(array.shape[1:]) for array in forms(world, channels, reports).values())


def _ticks_fit(each: int, world: World, ticks: int, memory: int, or_else: str = "") -> Finding:
    most = int(memory / each)
    return _fits(
        each * ticks,
        memory,
        f"{ticks} ticks of {world.formation.agents} agents",
        f"at most {most} ticks fit, a time.duration of {most * world.dt:g} s{or_else}",
    )


def _fits(needed: float, memory: int, what: str, way_out: str) -> Finding:
    said = f"{what} take {_bytes(needed)} of memory"
    has = f"this machine has {_bytes(memory)}"
    if needed > memory:
        return Finding("memory", "error", f"{said}, and {has}; {way_out}")
    return Finding("memory", "ok", f"{said}; {has}")


def messages(
    bits: np.ndarray[Any, np.dtype[np.float64]],
    world: World,
    reports: Mapping[str, tuple[int, ...]],
    trust: TrustSection,
) -> list[Finding]:
    """Whether what agents say in a tick is less than the scenario has taken for too much.

    Parameters
    ----------
    bits
        Of a message on each channel, as a rate limit counts them.
    world, reports
        Of the run, and what the estimator reports, by name, with the shape for one agent.
    trust
        What is taken.
    """
    dimension, degree = world.formation.dimension, world.links.slots.shape[1]
    believed = degree * (dimension + dimension * (dimension + 1) // 2 + 1)
    reported = sum(int(np.prod(shape)) for shape in reports.values())
    act = np.dtype(np.float64).itemsize * (dimension + believed + reported)
    found = []
    if (largest := max(act, int(bits.max()) // 8) + _AROUND) > trust.largest_message:
        says = f"agents say up to {_bytes(largest)} at once, and {_bytes(trust.largest_message)} are taken"
        found.append(Finding("messages", "error", f"{says}; raise trust.largest_message"))
    if (most := len(bits)) > trust.messages_per_tick:
        says = f"agents speak {most} times in a tick, and {trust.messages_per_tick} messages are looked at"
        found.append(Finding("messages", "error", f"{says}; raise trust.messages_per_tick"))
    return found


def delays(
    classes: Iterable[LinkClass], message_bits: np.ndarray[Any, np.dtype[np.float64]], time: TimeSection
) -> None:
    """Refuse what no message of the run outlives, or none would notice.

    Raises
    ------
    ScenarioError
        Naming the key, and the bound.
    """
    for one in classes:
        if one.delay_ticks > time.ticks:
            raise ScenarioError(
                f"network.delay_ticks: {one.delay_ticks} ticks, and the run has {time.ticks}: give fewer"
            )
        key, profile = f"network.profiles.{one.name}", one.profile
        for number, loss in enumerate(profile.loss or [], start=1):
            if "extra_delay" in type(loss).model_fields:
                delay(f"{key}.loss.{number}.extra_delay", getattr(loss, "extra_delay", 0.0), time)
        if (model := profile.delay) is not None:
            for name in ("mean", "jitter"):
                delay(f"{key}.delay.{name}", getattr(model, name) or 0.0, time)
            if len(one.measured):
                for seconds in (one.measured.min(), one.measured.max()):
                    delay(f"{key}.delay.{model.model}", float(seconds), time)
        if profile.rate is not None and profile.rate.rate is not None:
            least = float(message_bits[1:].max()) / time.duration
            if profile.rate.rate < least:
                raise ScenarioError(
                    f"{key}.rate.rate: at {profile.rate.rate:g} bit/s a message takes longer than the run of "
                    f"{time.duration:g} s; give at least {least:g}"
                )


def delay(key: str, seconds: float, time: TimeSection) -> None:
    """Refuse a delay that is longer than the run, or too short for its ticks.

    Raises
    ------
    ScenarioError
        Naming the key, and the bound.
    """
    if seconds > time.duration:
        raise ScenarioError(f"{key}: {seconds:g} s is longer than the run; give at most {time.duration:g} s")
    if 0.0 < seconds < _LEAST_OF_A_TICK * time.dt:
        least = _LEAST_OF_A_TICK * time.dt
        raise ScenarioError(
            f"{key}: {seconds:g} s is nothing in ticks of {time.dt:g} s; give 0, or at least {least:g} s"
        )


def parameters(key: str, given: Any) -> None:
    """Refuse numbers that are too large, or too small to tell from 0, in the parameters of an algorithm.

    Raises
    ------
    ScenarioError
        Naming the key, and the bound.
    """
    match given:
        case dict():
            for name, value in given.items():
                parameters(f"{key}.{name}", value)
        case list() | tuple():
            for number, value in enumerate(given, start=1):
                parameters(f"{key}.{number}", value)
        case int() | float() if not abs(given) <= LARGEST:
            raise ScenarioError(f"{key}: should be at most {LARGEST:g} in size, got {given}")
        case int() | float() if 0 < abs(given) < SMALLEST:
            raise ScenarioError(f"{key}: is too small to tell from 0: should be at least {SMALLEST:g}, got {given}")


def _bytes(number: float) -> str:
    power = int(np.clip(np.log2(max(number, 1.0)) // 10, 1, 3))
    return f"{number / 2.0 ** (10 * power):.3g} {('KiB', 'MiB', 'GiB')[power - 1]}"
