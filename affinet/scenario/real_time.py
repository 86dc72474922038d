"""What a scenario says of a run in real time: how fast it goes, and when agents act by their own clocks."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from affinet.scenario.events import Whom
from affinet.scenario.keys import key
from affinet.scenario.section import Section
from affinet.scenario.units import Positive, Rate

Share = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
Swing = Annotated[float, Field(ge=0.0, lt=0.5, allow_inf_nan=False)]
WakeRate = Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)]


class TimerSetting(Section):
    """When some agents act: how often in a tick, and when in it, in ticks of their own clocks.

    Those gain `drift` seconds per second. They wake at `phase`, too early or too late by up to `jitter`, speak, listen for
    `listens`, and act. Without `agents` it is everybody.
    """

    agents: Whom = key(["all"], "whose; without it everybody's")
    rate: WakeRate = key(1.0, "how often in a tick they wake")
    phase: Share = key(0.2, "when in a tick they wake, as a share of it")
    jitter: Swing = key(0.0, "by how much of a tick too early or too late, at most")
    drift: Rate = key(0.0, "seconds that their clocks gain per second")
    listens: Share = key(0.4, "for which share of a tick they listen before they act")


class RealTimeSection(Section):
    """Simulated seconds in a second, and by how many seconds a process may be late before the run fails.

    Of several timers that name an agent the last one holds.
    """

    factor: Positive = key(1.0, "simulated seconds in a second")
    late: Positive = key(1.0, "by how much a process may be late, or silent, before the run fails", "s")
    timers: list[TimerSetting] = key(list, "when some agents act; the last that names an agent holds")

    @model_validator(mode="after")
    def _whole(self) -> RealTimeSection:
        for timer in self.timers:
            if timer.phase + timer.jitter + timer.listens > 1.0 / timer.rate:
                raise ValueError(
                    f"an agent that wakes at {timer.phase:g} (jitter {timer.jitter:g}) and listens for {timer.listens:g} "
                    f"of a tick acts after it should have waked again; shorten them to {1.0 / timer.rate:g} together"
                )
        return self
