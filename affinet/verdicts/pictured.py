"""A run as pictures draw it: what stands in the scene, in the colours of recordings, and what matters of it over time."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from affinet.verdicts import measures, told
from affinet.verdicts.evidence import Evidence
from netem.medium.verdict import Verdict
from world.recording import palette

if TYPE_CHECKING:
    from analysis.figures.swarm import Flight


def flight(run: Evidence, title: str) -> Flight:
    """What is drawn of a run, under a title."""
    from analysis.figures.swarm import Flight  # matplotlib takes a while to import

    world, scenery = run.plan.world, run.plan.scenery
    quantity, values = measures.over_time(run.plan, run.timeline, run.arrays)
    return Flight(
        title=title,
        seconds=run.seconds,
        position=run.position,
        target=run.arrays["target"],
        leaders=world.formation.is_leader,
        edges=world.formation.ends,
        heard=np.stack([world.links.src, world.links.dst], axis=1) - 1,
        verdicts=run.arrays["verdicts"][:, 0],
        colours=_colours(),
        error=values,
        quantity=quantity,
        walls=[np.array(wall) for wall in scenery.walls],
        zones=[(np.array(zone.centre), zone.radius) for zone in scenery.zones],
    )


def png(run: Evidence) -> bytes:
    """How it ended, as a file holds it."""
    from analysis.figures import swarm

    file = io.BytesIO()
    swarm.still([flight(run, told.title(run))], float(run.seconds[-1]), file)
    return file.getvalue()


def _colours() -> Sequence[tuple[str, str]]:
    names = ["" if verdict is Verdict.SILENT else verdict.label for verdict in Verdict]
    return [(name, palette.css(palette.OF_VERDICT[verdict])) for name, verdict in zip(names, Verdict, strict=True)]
