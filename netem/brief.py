"""What the medium process is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from analysis.models.arrays import Mask
from netem.core.links import Links
from netem.core.pace import Pace
from netem.faults.fault import Fault
from netem.faults.trigger import Trigger
from netem.impairments.profile import Profile
from netem.wire.arrays import Form
from netem.wire.intake import Trust
from netem.wire.session import Login


@dataclass(frozen=True)
class MediumBrief:
    """All the medium process is told.

    Parameters
    ----------
    run
        The run's name, part of every key.
    login, passwords
        Where to listen, and the password of each who logs in by one.
    seed, links, channels, profiles, faults, triggers
        What the medium is made of.
    injected
        Faults that an earlier run was given while it flew.
    recorded
        The journal of an earlier run that is to be judge of this one.
    dimension, forms
        D, and what the fields of each channel hold that agents look into.
    positioned
        Agents that have positioning, shape (N,).
    hosts
        For each process that carries several agents, which.
    trust
        What is taken from agents.
    journal, batch
        The file to write down every verdict in, and how many ticks at once.
    gaps
        Whether sensors may say nothing: where they are not simulated.
    pace, clock_s
        How time goes in a run in real time, None in lockstep; and how much the medium's clock shows more than the world's, in
        seconds.
    """

    run: str
    login: Login
    passwords: Mapping[str, str] = field(repr=False)
    seed: int
    links: Links
    channels: tuple[str, ...]
    profiles: tuple[Profile, ...]
    faults: tuple[Fault, ...]
    triggers: tuple[Trigger, ...]
    injected: tuple[Fault, ...]
    recorded: str | None
    dimension: int
    forms: Mapping[str, Mapping[str, Form]]
    positioned: Mask
    hosts: Mapping[int, tuple[int, ...]]
    trust: Trust
    journal: str
    batch: int
    gaps: bool
    pace: Pace | None
    clock_s: float
