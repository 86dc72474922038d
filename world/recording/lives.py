"""What a recording shows of the processes: whether each lives, what was imposed, and how late it was."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from netem.faults.conditions import Conditions
from netem.faults.timeline import Timeline
from world.books.kept import Kept
from world.recording import palette
from world.recording.stage import Stage, Stretch

_STATES = {
    "flies": 0x2E7D4FFF,
    "paused": palette.PAUSED,
    "departed": palette.DEPARTED,
    "dead": palette.DEAD,
    "gone": 0x303030FF,
}


class Lives:
    """Logs the life of each agent's process, and the faults as they begin and end.

    Parameters
    ----------
    stage
        Where.
    agents
        How many.
    """

    def __init__(self, stage: Stage, agents: int) -> None:
        self._stage, self._agents = stage, agents
        self._was: list[str | None] = [None] * agents
        self._under: Conditions | None = None

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        self._was, self._under = [None] * self._agents, None
        states = rr.StateConfiguration(
            values=list(_STATES), labels=list(_STATES), colors=np.array([*_STATES.values()], dtype=np.uint32)
        )
        for agent in range(1, self._agents + 1):
            self._stage.still(f"processes/{agent}", states)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        self._log_events(stretch)
        changes: dict[int, list[tuple[int, str]]] = {}
        for tick in stretch.moments.ticks.tolist():
            conditions = stretch.timeline.at(tick)
            if conditions is self._under:  # the same object for as long as nothing changes
                continue
            self._under, now = conditions, states(conditions)
            for agent, (before, state) in enumerate(zip(self._was, now, strict=True), start=1):
                if state != before:
                    changes.setdefault(agent, []).append((tick, state))
            self._was = [*now]
        for agent, changed in changes.items():
            ticks, said = zip(*changed, strict=True)
            columns = rr.StateChange.columns(state=said)
            self._stage.stream.send_columns(f"processes/{agent}", self._stage.times(ticks), columns)

    def _log_events(self, stretch: Stretch) -> None:
        said = [(tick, *line) for tick in stretch.moments.ticks.tolist() for line in _said_of(stretch.timeline, tick)]
        if said:  # all at once: of each row that is logged by itself the library keeps something to the end of the run
            ticks, texts, levels = zip(*said, strict=True)
            columns = rr.TextLog.columns(text=texts, level=levels)
            self._stage.stream.send_columns("events", self._stage.times(ticks), columns)


def states(now: Conditions) -> list[str]:
    """What each agent does."""
    masks = [now.vanished, now.dead, now.departed, now.paused]
    said: list[str] = np.select(masks, ["gone", "dead", "departed", "paused"], "flies").tolist()
    return said


def _said_of(timeline: Timeline, tick: int) -> list[tuple[str, str]]:
    """What begins and ends in a tick, and at which level that is said."""
    started = [(fault.describe(), "WARN") for fault in timeline.starting(tick)]
    return started + [(fault.describe_end(), "INFO") for fault in timeline.ending(tick)]


def log_kept(stage: Stage, kept: Sequence[Kept], every: int) -> None:
    """Log how late processes were, in milliseconds, in the ticks that are recorded."""
    shown = [one for one in kept if one.tick % every == 0]
    for process in sorted({one.process for one in shown}):
        of_process = [one for one in shown if one.process == process]
        late = np.array([[1000.0 * one.late] for one in of_process])
        path = f"timing/{process.replace(' ', '_')}"
        stage.scalars(path, stage.times([one.tick for one in of_process]), late)
