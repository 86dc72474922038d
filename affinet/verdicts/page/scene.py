"""What the scene of a page is drawn of: moments of a run, seen from above, or aslant in space."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from affinet.verdicts.evidence import Evidence
from analysis.models.arrays import Array, Integers
from netem.medium.verdict import Verdict
from world.recording import palette

_MOST_MOMENTS = 600
_TRAIL_S, _SHOWN_IN_S = 8.0, 15.0  # how much of the way is shown; how long it takes to play all
_YAW, _PITCH = np.radians(-35.0), np.radians(25.0)


def of_run(run: Evidence) -> dict[str, Any]:
    """The scene of a run, as JSON says it."""
    world, scenery = run.plan.world, run.plan.scenery
    moments = shown(run)
    seconds = run.seconds[moments]
    position, target = _seen(run.position[moments]), _seen(run.arrays["target"][moments])
    step = float(seconds[1] - seconds[0]) if len(seconds) > 1 else run.dt
    return {
        "seconds": seconds.round(4).tolist(),
        "position": _packed(position, np.float32),
        "target": _packed(target, np.float32),
        "verdicts": _packed(run.arrays["verdicts"][moments, 0], np.uint8),
        "colours": [
            None if verdict is Verdict.SILENT else palette.css(palette.OF_VERDICT[verdict]) for verdict in Verdict
        ],
        "leaders": world.formation.is_leader.tolist(),
        "edges": world.formation.ends.tolist(),
        "heard": (np.stack([world.links.src, world.links.dst], axis=1) - 1).tolist(),
        "walls": [_seen(np.array(wall)).round(3).tolist() for wall in scenery.walls],
        "zones": [[*_seen(np.array(zone.centre)).tolist(), zone.radius] for zone in scenery.zones],
        "extent": np.nanmax(np.ptp(target, axis=1), axis=0).tolist(),
        "trail": round(_TRAIL_S / step),
        "speed": max(1.0, float(seconds[-1]) / _SHOWN_IN_S),
        "gold": palette.css(palette.LEADER),
        "blue": palette.css(palette.FOLLOWER),
    }


def shown(run: Evidence) -> Integers:
    """The ticks that are shown, the last among them."""
    number = min(run.ticks, _MOST_MOMENTS)
    chosen: Integers = np.linspace(0, run.ticks - 1, number).round().astype(np.int64)
    return chosen


def _seen(places: Array) -> Array:
    """Points (..., D) as points of a plane (..., 2)."""
    if places.shape[-1] == 2:
        return places
    x, y, z = np.moveaxis(places, -1, 0)
    across, along = x * np.cos(_YAW) - y * np.sin(_YAW), x * np.sin(_YAW) + y * np.cos(_YAW)
    return np.stack([across, along * np.sin(_PITCH) + z * np.cos(_PITCH)], axis=-1)


def _packed(values: NDArray[Any], kind: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()
