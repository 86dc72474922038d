"""Losses of a user's own in the profiles of a scenario: found, checked, and tried before anything flies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from affinet.planning import registry
from affinet.planning.link_classes import LinkClass
from affinet.scenario.profiles import IMPAIRMENTS, LinkProfile, Own
from analysis.models.arrays import Array
from netem.core.links import Links
from netem.impairments.own import OwnLoss
from netem.loading.choice import Choice
from netem.medium.own_losses import OwnLosses

_MOST_DRAWS = 1024

OwnModules = Mapping[str, Path]


def check(profiles: Mapping[str, LinkProfile], own: OwnModules) -> None:
    """Refuse what cannot be made, also in profiles that are not in use: a study may choose them.

    Raises
    ------
    ScenarioError
        When there is no such loss, or its parameters do not fit.
    UserCodeError
        When its module cannot be imported, or it is not what a loss has to be.
    """
    for name, profile in profiles.items():
        for number, model in profile.own:
            _chosen(f"network.profiles.{name}.loss.{number}", model, own)


def of_class(one: LinkClass, own: OwnModules) -> tuple[OwnLoss, ...]:
    """The losses of a user's own on a class of links."""
    before: Counter[str] = Counter()
    losses = []
    for _, model in one.profile.own:
        choice = _chosen(f"network.profiles.{one.name}", model, own)
        purpose = f"{choice.path} {before[choice.path]}"  # those of one name on a link share no draw
        before[choice.path] += 1
        losses.append(OwnLoss(choice, purpose, choice.build().by_position, one.rows, one.sensing, one.comms))
    return tuple(losses)


def try_out(losses: Sequence[OwnLoss], links: Links, dt: float, nominal: Array, *, coupled: bool) -> None:
    """Have each rule a tick in which all agents are at their nominal positions.

    Parameters
    ----------
    losses, links
        Which, and over which links.
    dt
        Tick, in seconds.
    nominal
        Nominal positions, shape (N, D), in metres.
    coupled
        Whether all channels of a link share a verdict.

    Raises
    ------
    UserCodeError
        When one fails, or returns something else than what is lost.
    """
    codes = np.arange(1 if coupled else 2)
    for loss in losses:
        OwnLosses(0, links, dt, loss, codes).lost(0, nominal)


def _chosen(key: str, model: Own, own: OwnModules) -> Choice:
    choice = registry.choose(IMPAIRMENTS, key, model.model, model.parameters, own)
    loss = choice.build()
    registry.refuse_other(
        loss, "by_position", lambda said: type(said) is bool, "whether it depends on where the agents are"
    )
    registry.refuse_other(
        loss,
        "draws",
        lambda said: type(said) is int and 0 <= said <= _MOST_DRAWS,
        f"how many uniform numbers it wants for each message, 0 to {_MOST_DRAWS}",
    )
    return choice
