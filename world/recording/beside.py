"""Several recordings as one, on one timeline: each run's scene beside the others', and its curves among theirs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from world.recording import palette
from world.recording.graphs import NARROW, WIDE
from world.recording.layout import Curves, scene
from world.recording.stage import TIMELINE

# What is compared, by entity, where one of the runs has it: its name, and those of its series.
_COMPARED: Mapping[str, tuple[str, Sequence[str]]] = {
    "metrics/localization": ("off the best places (log10 m)", ()),
    "metrics/target": ("error of the target (log10 m)", ("found by oneself", "agreed on")),
    "metrics/tracking_error": ("tracking error (log10 m²)", ()),
    "metrics/procrustes": ("off its shape (log10 m)", ()),
    "messages/delivered": ("messages delivered per tick", ()),
    "messages/lost": ("messages lost per tick", ()),
    "graph/connectivity": ("connectivity", ("sensing", "comms")),
    "graph/age": ("age of information (s)", ("sensing", "comms")),
}


@dataclass(frozen=True)
class RecordedRun:
    """A run to be shown.

    Parameters
    ----------
    name
        What people call it; of several runs each has another.
    parts
        The files of its recording.
    flat, reach, duration_s
        Whether it flies in a plane, how large its formation is, in metres, and how long it flies.
    """

    name: str
    parts: Sequence[Path]
    flat: bool
    reach: float
    duration_s: float


def beside(runs: Sequence[RecordedRun], path: Path) -> None:
    """Write one recording of several.

    Raises
    ------
    OSError
        When it cannot be written.
    ValueError
        When one of them cannot be read.
    """
    stream = rr.RecordingStream("affinet", recording_id="beside")
    found: dict[str, list[int]] = {}
    stream.save(str(path), default_blueprint=None)
    for number, run in enumerate(runs):
        for entity in _copy(stream, run):
            found.setdefault(entity, []).append(number)
    for entity in _COMPARED.keys() & found.keys():
        for number in found[entity]:
            stream.log(_path(runs[number], entity), _series(runs[number].name, entity, number), static=True)
    stream.send_recording_name(", ".join(run.name for run in runs))
    stream.send_blueprint(_blueprint(runs, found))
    stream.disconnect()


def _copy(stream: rr.RecordingStream, run: RecordedRun) -> Iterator[str]:
    """Copy all that is in a recording below its name: which entities there are."""
    seen = set()
    for part in run.parts:
        for chunk in RrdReader(str(part)).stream():
            entity = str(chunk.entity_path).lstrip("/")
            if not entity.startswith("__"):
                stream.send_chunks(chunk.with_entity_path(_path(run, entity)))
                seen.add(entity)
    yield from sorted(seen)


def _series(name: str, entity: str, number: int) -> rr.SeriesLines:
    _, series = _COMPARED[entity]
    names = [f"{name}, {one}" for one in series] or [name]
    widths = [WIDE, NARROW] if series else [NARROW]
    colours = np.array([palette.of_agents(number + 1)[-1]] * len(names), dtype=np.uint32)
    return rr.SeriesLines(names=names, colors=colours, widths=widths)


def _blueprint(runs: Sequence[RecordedRun], found: dict[str, list[int]]) -> rrb.Blueprint:
    curves = Curves(max(run.duration_s for run in runs))
    compared = [
        curves.view("/", name, contents=[f"/{_path(runs[number], entity)}" for number in found[entity]])
        for entity, (name, _) in _COMPARED.items()
        if entity in found
    ]
    scenes = [scene(_path(run, "swarm"), run.name, run.reach, flat=run.flat) for run in runs]
    settings = [rrb.TextDocumentView(origin=_path(run, "settings"), name=f"settings of {run.name}") for run in runs]
    half = (len(compared) + 1) // 2
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Grid(*scenes),
            rrb.Horizontal(rrb.Tabs(*compared[:half]), rrb.Tabs(*compared[half:]), rrb.Tabs(*settings)),
            row_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )


def _path(run: RecordedRun, entity: str) -> str:
    return f"{rr.escape_entity_path_part(run.name)}/{entity}"
