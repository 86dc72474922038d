"""The table of the network: what happens to messages on which links, and where it is jammed."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from affinet.scenario.events import Links
from affinet.scenario.keys import key
from affinet.scenario.profiles import LinkProfile
from affinet.scenario.section import Section
from affinet.scenario.units import Finite, Positive, Probability, Ticks


class LinkSetting(Section):
    """Links that differ from the others, in all channels or in those of one class."""

    links: Links = key(..., 'which, like "2->4", "2-4", "leaders->followers"')
    channels: Literal["sensing", "comms"] | None = key(None, "only those of this class")
    profile: str | None = key(None, "what happens on them, in place of the profile of all")
    availability: Probability | None = key(None, "probability that a message gets through")
    delay_ticks: Ticks | None = key(None, "one-way delay of communication, in ticks")


class JammedZone(Section):
    """A disk (ball) in which nobody hears anything in a `share` of all ticks, all at once; metres."""

    centre: list[Finite] = key(..., "of the disk, or ball", "m")
    radius: Positive = key(..., "of it", "m")
    share: Probability = key(1.0, "of all ticks in which nobody in it hears anything")
    links: Links = key("all", "to which links it does so")
    channels: Literal["sensing", "comms"] | None = key(None, "only to channels of this class")


class NetworkSection(Section):
    """The air: a named profile, on top of an availability (probability that a message passes) and a delay in ticks, one way.

    `coupled` is Assumption 1 of paper 000: one verdict per directed link and tick for sensing and communication.
    """

    availability: Probability = key(1.0, "probability that a message gets through")
    delay_ticks: Ticks = key(0, "one-way delay of communication, in ticks; sensing is not delayed")
    coupled: bool = key(True, "one verdict per directed link and tick for sensing and communication (Assumption 1)")
    profile: str = key("perfect", "what happens on all links, by name (`affinet list profiles`)")
    profiles: dict[str, LinkProfile] = key(dict, "profiles of your own, a table each")
    links: list[LinkSetting] = key(list, "links that differ from the others; later ones win")
    zones: list[JammedZone] = key(list, "disks (balls) in which nobody hears anything")

    @model_validator(mode="after")
    def _apart(self) -> NetworkSection:
        if self.coupled and any(setting.channels for setting in self.links):
            raise ValueError("links set channels apart, but coupled = true gives sensing and comms one verdict")
        return self
