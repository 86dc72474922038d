"""Losses by distance as they stand in a scenario."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from affinet.scenario.keys import key
from affinet.scenario.section import Section
from affinet.scenario.units import NotNegative, Positive


class Disk(Section):
    """Everything within `range` metres, nothing beyond."""

    model: Literal["disk"]
    range: Positive = key(..., "how far messages reach", "m")


class Ramp(Section):
    """Everything up to `inner` metres, nothing from `outer` on, in proportion between."""

    model: Literal["ramp"]
    inner: NotNegative = key(..., "up to where everything passes", "m")
    outer: Positive = key(..., "from where on nothing does", "m")

    @model_validator(mode="after")
    def _ordered(self) -> Ramp:
        if self.inner > self.outer:
            raise ValueError(f"inner {self.inner:g} m lies beyond outer {self.outer:g} m")
        return self


class LogDistance(Section):
    """Log-distance path loss with shadowing: half of the messages pass at `range` metres."""

    model: Literal["log-distance"]
    range: Positive = key(..., "where half of the messages pass", "m")
    exponent: Positive = key(3.0, "of the path loss")
    shadowing: NotNegative = key(4.0, "its standard deviation", "dB")
    coherence: NotNegative = key(0.0, "over which shadowing stays alike", "s")
