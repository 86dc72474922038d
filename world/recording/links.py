"""What a recording shows of the links: the graph that works, how old its news is, and each message in space and time."""

from __future__ import annotations

import numpy as np
import rerun as rr

from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.medium.verdict import COUNTED, Verdict
from world.books.counted import per_tick
from world.physics.world import World
from world.recording import palette
from world.recording.stage import Colours, Stage, Stretch, spatial

_PALETTE = np.array([palette.OF_VERDICT[verdict] for verdict in Verdict], dtype=np.uint32)
MOST_IN_A_MATRIX = 60  # agents, whose matrix is drawn
_OLD_S = 1.0  # an age that is drawn as the oldest
_FRESH, _STALE, _NEVER = np.array([61, 220, 132.0]), np.array([176, 42, 48.0]), np.array([70, 70, 82])
SWEEP = 12  # recorded moments beside each other, after which the diagram of messages begins again at its left
SHAPE = 4.0  # how much wider it is than the rows of all agents are high


class Graph:
    """Logs the nominal graph, and the one that works: half an edge for each direction.

    Parameters
    ----------
    stage
        Where.
    world
        What is flown.
    """

    def __init__(self, stage: Stage, world: World) -> None:
        self._stage, self._links, self._ends = stage, world.links, world.formation.ends

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        nominal = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.5), colors=0x55555580)
        self._stage.still("swarm/graph/nominal", nominal)
        self._stage.still("swarm/graph/functional", rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(1.8)))

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        position, links = spatial(stretch.position), self._links
        receiver, sender = position[:, links.dst - 1], position[:, links.src - 1]
        # The half at an agent shows whether that agent hears and sees the other.
        halves = np.stack([(receiver + sender) / 2, receiver], axis=-2)
        colours = _PALETTE[stretch.moments.verdicts[stretch.kept, 0]]
        self._stage.segments("swarm/graph/functional", stretch.time, halves, colours)
        self._stage.segments("swarm/graph/nominal", stretch.time, position[:, self._ends])


class MessageCurves:
    """Logs how many messages became what, in each tick on average; of what has not happened there is no curve.

    Parameters
    ----------
    stage
        Where.
    every
        Ticks from one recorded moment to the next.
    """

    def __init__(self, stage: Stage, every: int) -> None:
        self._stage, self._every = stage, every
        self._told: set[Verdict] = set()

    def begin(self) -> None:
        """Nothing has happened yet."""
        for verdict in self._told:
            self._name(verdict)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        for verdict in COUNTED:
            means = per_tick(stretch.moments.verdicts, verdict, self._every)
            if verdict not in self._told and means.any():
                self._told.add(verdict)
                self._name(verdict)
            if verdict in self._told:
                self._stage.scalars(f"messages/{verdict.label}", stretch.time, means[:, None])

    def _name(self, verdict: Verdict) -> None:
        says = rr.SeriesLines(names=verdict.label, colors=palette.OF_VERDICT[verdict])
        self._stage.still(f"messages/{verdict.label}", says)


class AgeMatrix:
    """Logs how old what each agent has of each other is, as an image: a row for who hears, a column for whom.

    Parameters
    ----------
    stage
        Where.
    links
        Of the run.
    """

    def __init__(self, stage: Stage, links: Links) -> None:
        self._stage, self._links, self._agents = stage, links, links.agents

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        middle, before = np.arange(self._agents) + 0.3, np.full(self._agents, -0.6)
        places = np.concatenate([np.stack([before, middle], -1), np.stack([middle, before], -1)])
        numbers = [str(agent) for agent in range(1, self._agents + 1)]
        labels = rr.Points2D(places, labels=numbers * 2, radii=0.0, show_labels=True)
        self._stage.still("ages/numbers", labels)
        size = rr.components.ImageFormat(
            width=self._agents, height=self._agents, color_model="RGB", channel_datatype="U8"
        )
        self._stage.still("ages/matrix", rr.Image.from_fields(format=size))

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        pixels = np.zeros((len(stretch.ticks), self._agents, self._agents, 3), dtype=np.uint8)
        pixels[:, self._links.dst - 1, self._links.src - 1] = _by_age(stretch.realised.age_s[:, -1])
        images = rr.Image.columns(buffer=[image.tobytes() for image in pixels])
        self._stage.stream.send_columns("ages/matrix", stretch.time, images)


def _by_age(age_s: Array) -> Colours:
    """A colour (T, L, 3) for each age (T, L), in seconds."""
    share = np.clip(age_s / _OLD_S, 0.0, 1.0)[..., None]
    shown = np.where(np.isnan(share), _NEVER, _FRESH + (_STALE - _FRESH) * np.nan_to_num(share))
    return shown.astype(np.uint8)


class SpaceTime:
    """Logs the broadcasts of each recorded moment as lines from who speaks to who hears: time to the right, a row an agent.

    What arrives begins when it was said; what is dropped ends half-way. The senders of a moment stand beside each other.

    Parameters
    ----------
    stage
        Where.
    links
        Who is linked to whom.
    every
        Ticks from one recorded moment to the next.
    """

    def __init__(self, stage: Stage, links: Links, every: int) -> None:
        self._stage, self._links, self._every = stage, links, every
        self._agents = links.agents

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        rows, width = np.arange(1.0, self._agents + 1.0), SHAPE * self._agents
        lines = np.stack(
            [np.stack([np.zeros_like(rows), rows], -1), np.stack([np.full_like(rows, width), rows], -1)], 1
        )
        numbers = [str(agent) for agent in range(1, self._agents + 1)]
        self._stage.still("spacetime/rows", rr.LineStrips2D(lines, colors=0x50506080, radii=rr.Radius.ui_points(0.5)))
        names = rr.Points2D(
            np.stack([np.full(self._agents, -0.5), rows - 0.4], -1), labels=numbers, radii=0.0, show_labels=True
        )
        self._stage.still("spacetime/numbers", names)
        self._stage.still("spacetime/messages", rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.0)))

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        ticks = np.array(stretch.ticks)
        verdicts, newest = (of[stretch.kept, -1] for of in (stretch.moments.verdicts, stretch.moments.newest))
        arrived = newest >= 0
        dropped = ~arrived & (verdicts >= Verdict.DEAD)
        age = np.where(arrived, ticks[:, None] - newest, 0)
        ends = self._ends(ticks, age, dropped)
        colours = np.where(arrived, np.where(age > 0, _PALETTE[Verdict.DELAYED], _PALETTE[Verdict.DELIVERED]), 0)
        colours = np.where(dropped, _PALETTE[verdicts], colours).astype(np.uint32)
        shown = arrived | dropped
        columns = rr.LineStrips2D.columns(strips=ends[shown], colors=colours[shown])
        self._stage.stream.send_columns("spacetime/messages", stretch.time, columns.partition(shown.sum(axis=1)))

    def _ends(self, ticks: Integers, age: Integers, dropped: Mask) -> Array:
        """Where the line of each message begins and ends, shape (T, L, 2, 2)."""
        moment = (ticks // self._every % SWEEP)[:, None] + (self._links.src - 1) / (1.2 * self._agents)
        said, heard = np.broadcast_to(self._links.src, age.shape), np.broadcast_to(self._links.dst, age.shape)
        until = np.where(dropped, (said + heard) / 2.0, heard)
        wide = SHAPE * self._agents / SWEEP
        begins = np.stack([wide * (moment - age / self._every), said], axis=-1)
        ends = np.stack([wide * (moment + 0.5 / self._agents), until], axis=-1)
        return np.stack([begins, ends], axis=-2)
