"""What an algorithm wants of the swarm that flies it."""

from __future__ import annotations

from typing import NamedTuple


class Wants(NamedTuple):
    """What an estimator or a law wants beyond what every agent gets.

    Parameters
    ----------
    position
        That every agent knows where it is (`own.position`), and not leaders alone.
    mission
        That every agent is told the manoeuvre (`brief.mission`), and not leaders alone.
    synchronous
        That what is said in a tick can be heard in it: with next-tick exchange, or a delay of whole ticks for all messages, the
        scenario is refused. A message that is late by itself counts as one that is lost.
    everybody
        That nobody is killed or paused.
    """

    position: bool = False
    mission: bool = False
    synchronous: bool = False
    everybody: bool = False
